// What lies beside a file until it is complete, and names that lead out of a folder.
#include "io/atomic_file.hpp"
#include "io/inside.hpp"
#include "io/temporary.hpp"

#include <gtest/gtest.h>

#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <set>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;

class Temporary : public ::testing::Test {
  protected:
    void SetUp() override {
        std::string name = (fs::temp_directory_path() / "clspeckle-test-XXXXXX").string();
        ASSERT_TRUE(mkdtemp(name.data()));
        folder_ = name;
    }
    void TearDown() override { fs::remove_all(folder_); }

    std::string path(const std::string &name) const { return (folder_ / name).string(); }
    std::set<std::string> names() const {
        std::set<std::string> result;
        for (const auto &entry : fs::directory_iterator(folder_))
            result.insert(entry.path().filename().string());
        return result;
    }
    // The end of a process of its own, as waitpid() tells it.
    static int in_a_child(const std::function<void()> &body) {
        const pid_t child = ::fork();
        if (child == 0) {
            body();
            ::_exit(0);
        }
        int status = 0;
        ::waitpid(child, &status, 0);
        return status;
    }
    // As when the power goes: nothing of the program runs any more.
    void write_and_be_killed() const {
        const int status = in_a_child([&] {
            image_io::AtomicFile file(path("frame.npy"));
            file.write("half", 4);
            image_io::TemporaryLock lock;
            const std::string inner = image_io::make_temporary_folder(path("set"), lock);
            image_io::AtomicFile within(inner + "/dark.npy");
            ::raise(SIGKILL);
        });
        ASSERT_TRUE(WIFSIGNALED(status));
    }

    fs::path folder_;
};

TEST_F(Temporary, NamesCannotBeForetold) {
    std::set<std::string> seen;
    int with_process = 0; // a name that is drawn has its number by chance, seldom
    for (int i = 0; i < 64; ++i) {
        const image_io::AtomicFile file(path("frame.npy"));
        const std::string name = fs::path(file.temporary_path()).filename().string();
        EXPECT_TRUE(seen.insert(name).second);
        EXPECT_EQ(name.find("frame"), std::string::npos);
        with_process += name.find(std::to_string(::getpid())) != std::string::npos;
        EXPECT_EQ(name.size(), std::string(".clspeckle-0123456789abcdef.part.npy").size());
    }
    EXPECT_LT(with_process, 16);
    EXPECT_TRUE(names().empty());
}

TEST_F(Temporary, FilesHaveTheRightsThatTheUserWants) {
    const mode_t before = ::umask(027);
    image_io::write_text(path("a"), "text");
    ::umask(before);
    struct stat status {};
    ASSERT_EQ(::stat(path("a").c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777, 0640u);
}

TEST_F(Temporary, AFileKeepsTheRightsOfTheOneThatItReplaces) {
    const auto rights = [&](const std::string &name) {
        struct stat status {};
        EXPECT_EQ(::stat(name.c_str(), &status), 0) << name;
        return status.st_mode & 07777;
    };
    for (const mode_t mode : {0600u, 0640u, 0664u, 0444u, 0755u}) {
        image_io::write_text(path("a"), "before");
        ASSERT_EQ(::chmod(path("a").c_str(), mode), 0);
        image_io::AtomicFile file(path("a"));
        EXPECT_EQ(rights(file.temporary_path()), mode | 0200) << "nobody else reads it meanwhile";
        file.write("after", 5);
        file.commit();
        EXPECT_EQ(rights(path("a")), mode);
        ASSERT_EQ(::unlink(path("a").c_str()), 0);
    }
    // Not what a link leads to, and no rights beyond reading, writing and running.
    image_io::write_text(path("open"), "text");
    ASSERT_EQ(::chmod(path("open").c_str(), 0666), 0);
    fs::create_symlink("open", path("link"));
    const mode_t before = ::umask(027);
    image_io::write_text(path("link"), "text");
    ::umask(before);
    EXPECT_EQ(rights(path("link")), 0640u);
    ASSERT_EQ(::chmod(path("open").c_str(), 04755), 0);
    image_io::write_text(path("open"), "text");
    EXPECT_EQ(rights(path("open")), 0755u);
    if (::geteuid() != 0)
        return;
    ASSERT_EQ(::chown(path("open").c_str(), 65534, 65533), 0);
    image_io::write_text(path("open"), "text");
    struct stat status {};
    ASSERT_EQ(::stat(path("open").c_str(), &status), 0);
    EXPECT_EQ(status.st_uid, 65534u);
    EXPECT_EQ(status.st_gid, 65533u);
    // Who may not give files away: the new group is none that the file was open to.
    ASSERT_EQ(::chmod(path("open").c_str(), 0664), 0);
    ASSERT_EQ(::chmod(folder_.c_str(), 0777), 0);
    EXPECT_EQ(in_a_child([&] {
                  ::_exit(::setgid(1234) == 0 && ::setuid(1234) == 0 ? (image_io::write_text(path("open"), "text"), 7)
                                                                     : 1);
              }),
              7 << 8);
    ASSERT_EQ(::stat(path("open").c_str(), &status), 0);
    EXPECT_EQ(status.st_uid, 1234u);
    EXPECT_EQ(status.st_mode & 0777, 0644u);
}

TEST_F(Temporary, WhatAKilledProgramLeftIsSweptAway) {
    write_and_be_killed();
    EXPECT_EQ(names().size(), 2u);
    EXPECT_EQ(in_a_child([&] { image_io::write_text(path("next.txt"), "whole"); }), 0);
    EXPECT_EQ(names(), std::set<std::string>{"next.txt"});
}

TEST_F(Temporary, WhatIsBeingWrittenStays) {
    image_io::AtomicFile file(path("frame.npy"));
    image_io::TemporaryLock lock;
    const std::string set = image_io::make_temporary_folder(path("set"), lock);
    file.close(); // others may write on by the name
    EXPECT_EQ(in_a_child([&] {
                  image_io::write_text(path("next.txt"), "whole");
                  ::_exit(fs::exists(file.temporary_path()) && fs::exists(set) ? 7 : 1);
              }),
              7 << 8);
    file.commit();
    EXPECT_TRUE(fs::exists(path("frame.npy")));
}

TEST_F(Temporary, NothingElseIsSweptAway) {
    const std::set<std::string> others = {
        ".clspeckle-0123456789abcde.part", ".clspeckle-0123456789abcdeg.part",    ".frame.npy.12-3.part",
        "clspeckle-0123456789abcdef.part", "old.clspeckle-0123456789abcdef.part", ".clspeckle-0123456789abcdef"};
    for (const std::string &name : others)
        std::ofstream(path(name)) << "mine";
    fs::create_directory(path("elsewhere"));
    std::ofstream(path("elsewhere/file")) << "mine";
    fs::create_symlink("elsewhere", path(".clspeckle-00112233445566ff.part")); // not what it leads to
    EXPECT_EQ(in_a_child([&] { image_io::write_text(path("next.txt"), "whole"); }), 0);
    for (const std::string &name : others)
        EXPECT_TRUE(names().count(name)) << name;
    EXPECT_TRUE(fs::exists(path("elsewhere/file")));
}

TEST(Inside, NamesThatLeadOutOfTheFolder) {
    using image_io::leaves_folder;
    for (const char *name :
         {"/etc/passwd",       "..",       "../a", "a/..",   "a/../b", "a/../../b", "a/b/..",    "\\a",
          "a\\..\\b",          "C:\\a",    "c:a",  ".[.]/a", ".?/a",   ".*/a",      "a/.[!a]/b", "\\.\\./a",
          "a/\\.\\./\\.\\./b", "a/.\\./b", ".[.]", "..:R",   "//a"})
        EXPECT_TRUE(leaves_folder(name)) << name;
    EXPECT_TRUE(leaves_folder(std::string("a\0/../b", 7)));
    for (const char *name : {"a", "a/b", "...", "a..b", "..a", "a..", ".hidden", "./a", "a//b", "*", "a*/b?.png",
                             "frame_[0-9]*.png", "*.*", "?.png", "[.].png", "[.][.]/a", "*/a", "dark.npy:R", ""})
        EXPECT_FALSE(leaves_folder(name)) << name;
}

} // namespace
