#include "runtime/whole_file.hpp"

#include <atomic>
#include <fmt/core.h>
#include <fstream>
#include <string>
#include <system_error>

#include <unistd.h>

namespace clsp {

bool write_whole_file(const std::filesystem::path &path, const std::function<void(std::ostream &)> &write) {
    namespace fs = std::filesystem;
    std::error_code failed;
    fs::create_directories(path.parent_path(), failed);
    if (failed)
        return false;
    static std::atomic<unsigned> counter{0};
    const fs::path temporary = fmt::format("{}.{}.{}", path.string(), ::getpid(), counter++);
    bool good = false;
    {
        std::ofstream file(temporary, std::ios::binary);
        write(file);
        file.close();
        good = file.good();
    }
    if (good)
        fs::rename(temporary, path, failed);
    if (good && !failed)
        return true;
    fs::remove(temporary, failed);
    return false;
}

} // namespace clsp
