#include "runtime/whole_file.hpp"

#include <system_error>

namespace clsp {

bool write_whole_file(const std::filesystem::path &path, const std::function<void(image_io::AtomicFile &)> &write) {
    std::error_code failed;
    std::filesystem::create_directories(path.parent_path(), failed);
    if (failed)
        return false;
    try {
        image_io::AtomicFile file(path.string());
        write(file);
        file.commit();
        return true;
    } catch (const image_io::WriteError &) {
        return false;
    }
}

} // namespace clsp
