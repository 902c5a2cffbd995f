#include "dataset.hpp"

#include "errors.hpp"
#include "python.hpp"

#include <clspeckle/clspeckle.h>
#include <fmt/format.h>

#include <dlfcn.h>

#include <cstdlib>
#include <filesystem>

namespace tools {

namespace {

namespace fs = std::filesystem;

/** The library that this program calls; empty if it is part of it. */
std::string this_library() {
    Dl_info info{};
    if (::dladdr(reinterpret_cast<void *>(&clspGetVersion), &info) == 0 || !info.dli_fname)
        return {};
    std::error_code code;
    const fs::path file = fs::canonical(info.dli_fname, code);
    return code || file == this_program() ? std::string() : file.string();
}

/** A program of a checkout runs the checkout's package, and that the program's library. */
void prefer_checkout() {
    const fs::path source = fs::path("bindings") / "python" / "src",
                   checkout =
                       folder_above(this_program().parent_path(), source / "clspeckle" / "dataset" / "__main__.py");
    if (checkout.empty())
        return;
    prepend_python_path(checkout / source);
    if (const std::string library = this_library(); !library.empty())
        ::setenv("CLSPECKLE_LIBRARY", library.c_str(), 0);
}

} // namespace

void run_dataset(const DatasetArguments &a, bool quiet) {
    prefer_checkout();
    need_modules(
        a.python, "numpy, clspeckle.dataset",
        "`clspeckle dataset` needs Python 3.9 or newer with NumPy and the package clspeckle, which is in Debian's "
        "python3-clspeckle and in a wheel (docs/guide/install.md); another Python is named with --python");
    std::vector<std::string> words = {
        a.python, "-m",      "clspeckle.dataset",        a.recipe,       "--out",
        a.folder, "--count", fmt::format("{}", a.count), "--shard-size", fmt::format("{}", a.shard_size)};
    const auto add = [&](const char *option, const std::string &value) {
        if (!value.empty())
            words.insert(words.end(), {option, value});
    };
    add("--workers", a.workers > 0 ? fmt::format("{}", a.workers) : std::string());
    add("--threads", a.threads > 0 ? fmt::format("{}", a.threads) : std::string());
    add("--devices", a.devices);
    add("--cluster", a.cluster);
    if (a.format != "webdataset")
        add("--format", a.format);
    if (a.without_ideal)
        words.emplace_back("--no-ideal");
    if (quiet)
        words.emplace_back("--quiet");
    become_program(words);
    throw OutputError(fmt::format("{} cannot be started", a.python));
}

} // namespace tools
