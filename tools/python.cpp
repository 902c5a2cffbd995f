#include "python.hpp"

#include "errors.hpp"
#include "interrupt.hpp"

#include <fmt/format.h>

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>

namespace tools {

namespace fs = std::filesystem;

namespace {

constexpr int levels_up = 6; // from the program to the root of a checkout

} // namespace

fs::path this_program() {
    std::error_code code;
    const fs::path path = fs::read_symlink("/proc/self/exe", code);
    return code ? fs::path() : path;
}

fs::path folder_above(fs::path folder, const fs::path &part) {
    std::error_code code;
    for (int i = 0; i < levels_up && !folder.empty(); ++i, folder = folder.parent_path())
        if (fs::exists(folder / part, code))
            return folder;
    return {};
}

void become_program(const std::vector<std::string> &words) {
    std::vector<char *> pointers;
    for (const std::string &word : words)
        pointers.push_back(const_cast<char *>(word.c_str()));
    pointers.push_back(nullptr);
    sigset_t none; // this program's threads block what is to stop the other one
    ::sigemptyset(&none);
    ::pthread_sigmask(SIG_SETMASK, &none, nullptr);
    ::execvp(pointers.front(), pointers.data());
}

int run_program(const std::vector<std::string> &words, const std::string &output, bool silent) {
    const pid_t child = ::fork();
    if (child < 0)
        throw OutputError(fmt::format("{} cannot be started: {}", words.front(), std::strerror(errno)));
    if (child == 0) {
        const int to = ::open(output.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
        if (to >= 0)
            ::dup2(to, STDOUT_FILENO);
        if (silent && to >= 0)
            ::dup2(to, STDERR_FILENO);
        become_program(words);
        ::_exit(no_program);
    }
    int status = 0;
    bool told = false;
    while (::waitpid(child, &status, WNOHANG) == 0) {
        // A terminal tells the whole group; a signal to this program alone is passed on.
        if (!told)
            try {
                check_interrupt();
            } catch (const Interrupted &) {
                ::kill(child, SIGINT);
                told = true;
            }
        ::usleep(50000);
    }
    if (told)
        throw Interrupted();
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

void need_modules(const std::string &python, const std::string &modules, const std::string &needs) {
    const std::string code = fmt::format("import sys\nassert sys.version_info >= (3, 9), sys.version\n"
                                         "try:\n    import {}\nexcept ImportError as error:\n    sys.exit(error)",
                                         modules);
    const int result = run_program({python, "-c", code}, "/dev/null", false);
    if (result == no_program)
        throw InputError(fmt::format("there is no program {}; {}", python, needs));
    if (result != 0)
        throw InputError(needs);
}

void prepend_python_path(const fs::path &folder) {
    const char *path = ::secure_getenv("PYTHONPATH");
    const std::string folders = folder.string() + (path && *path ? std::string(":") + path : "");
    ::setenv("PYTHONPATH", folders.c_str(), 1);
}

} // namespace tools
