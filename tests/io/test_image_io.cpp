// The image writers: what they write reads back exactly, and a file that cannot be written whole is not there at all.
#include "io/formats.hpp"

#include <gtest/gtest.h>

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <iterator>
#include <random>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t width = 97;
constexpr std::uint32_t height = 61;
constexpr std::size_t pixels = std::size_t{width} * height;

class ImageIo : public ::testing::Test {
  protected:
    void SetUp() override {
        folder_ = fs::temp_directory_path() / ("clspeckle-image-io-" + std::to_string(::getpid()));
        fs::remove_all(folder_);
        fs::create_directory(folder_);
        std::mt19937 random(1);
        for (std::size_t i = 0; i < pixels; ++i) {
            codes16_.push_back(static_cast<std::uint16_t>(random()));
            codes8_.push_back(static_cast<std::uint8_t>(random()));
            values_.push_back(static_cast<float>(random()) * 1e-6f - 1000.0f);
        }
    }
    void TearDown() override { fs::remove_all(folder_); }

    std::string path(const std::string &name) const { return (folder_ / name).string(); }
    std::ptrdiff_t file_count() const {
        return std::distance(fs::directory_iterator(folder_), fs::directory_iterator());
    }

    template <typename T> void write(const std::string &name, const std::vector<T> &samples) const {
        image_io::write(path(name), *image_io::format_of_extension(name), width, height, samples.data());
    }
    static std::unique_ptr<image_io::Writer> begin_stack(const std::string &target, std::uint64_t frames) {
        return image_io::create(target, image_io::format_named("NPY"),
                                {width, height, image_io::Sample::float32, frames});
    }

    template <typename T>
    void expect_reads_back(const std::string &name, const std::vector<T> &expected, const char *sample) {
        std::vector<std::string> warnings;
        const auto reader = image_io::open(path(name));
        EXPECT_EQ(reader->info().sample, sample);
        const image_io::Plane plane = image_io::read_gray(*reader, 0, warnings);
        ASSERT_EQ(plane.width, width);
        ASSERT_EQ(plane.height, height);
        for (std::size_t i = 0; i < pixels; ++i)
            ASSERT_EQ(plane.values[i], static_cast<float>(expected[i])) << name << " at pixel " << i;
        EXPECT_TRUE(warnings.empty());
        EXPECT_EQ(file_count(), 1) << "a temporary file is left";
    }

    fs::path folder_;
    std::vector<std::uint16_t> codes16_;
    std::vector<std::uint8_t> codes8_;
    std::vector<float> values_;
};

TEST_F(ImageIo, Png16ReadsBack) {
    write("image.png", codes16_);
    expect_reads_back("image.png", codes16_, "uint16");
}

TEST_F(ImageIo, Png8ReadsBack) {
    write("image.png", codes8_);
    expect_reads_back("image.png", codes8_, "uint8");
}

TEST_F(ImageIo, Tiff16ReadsBack) {
    write("image.tiff", codes16_);
    expect_reads_back("image.tiff", codes16_, "uint16");
}

TEST_F(ImageIo, TiffFloatReadsBack) {
    write("image.tiff", values_);
    expect_reads_back("image.tiff", values_, "float32");
}

TEST_F(ImageIo, Npy16ReadsBack) {
    write("image.npy", codes16_);
    expect_reads_back("image.npy", codes16_, "uint16");
}

TEST_F(ImageIo, NpyFloatReadsBack) {
    write("image.npy", values_);
    expect_reads_back("image.npy", values_, "float32");
}

TEST_F(ImageIo, AWriterThatIsNotCommittedLeavesNothing) {
    {
        const auto stack = begin_stack(path("stack.npy"), 2);
        stack->append(values_.data());
        EXPECT_FALSE(fs::exists(path("stack.npy")));
        EXPECT_EQ(file_count(), 1);
    }
    EXPECT_EQ(file_count(), 0);
}

TEST_F(ImageIo, AnOlderFileStaysUntilTheNewOneIsWhole) {
    image_io::write_text(path("note.txt"), "old");
    {
        image_io::AtomicFile file(path("note.txt"));
        file.write("new", 3);
        EXPECT_EQ(fs::file_size(path("note.txt")), 3u);
    }
    EXPECT_EQ(file_count(), 1);
    image_io::write_text(path("note.txt"), "newer");
    EXPECT_EQ(fs::file_size(path("note.txt")), 5u);
}

TEST_F(ImageIo, AFolderThatDoesNotExistIsNamed) {
    const std::string target = path("missing/image.npy");
    try {
        write("missing/image.npy", values_);
        FAIL() << "it was written";
    } catch (const image_io::WriteError &error) {
        EXPECT_NE(std::string(error.what()).find(target), std::string::npos) << error.what();
    }
}

// A limit on the size of files stands for a full disk. It holds for a child process, which tells by its exit code how
// the writer ended: 0 WriteError naming the file, 1 another exception, 2 none.
TEST_F(ImageIo, AFullDiskIsAnErrorAndLeavesNothing) {
    const std::vector<std::pair<std::string, std::function<void()>>> writers = {
        {"image.png", [&] { write("image.png", codes16_); }},
        {"preview.png", [&] { write("preview.png", codes8_); }},
        {"codes.tiff", [&] { write("codes.tiff", codes16_); }},
        {"values.tiff", [&] { write("values.tiff", values_); }},
        {"codes.npy", [&] { write("codes.npy", codes16_); }},
        {"stack.npy",
         [&] {
             const auto stack = begin_stack(path("stack.npy"), 1);
             stack->append(values_.data());
             stack->commit();
         }},
        {"long.txt", [&] { image_io::write_text(path("long.txt"), std::string(10000, 'x')); }},
    };
    for (const auto &[name, writer] : writers) {
        // The smallest limit fails at the first byte, the others within the data or at the end.
        for (const rlim_t limit : {rlim_t{0}, rlim_t{100}, rlim_t{4096}, rlim_t{5900}}) {
            const std::string target = path(name);
            const pid_t child = ::fork();
            ASSERT_GE(child, 0);
            if (child == 0) {
                std::signal(SIGXFSZ, SIG_IGN);
                const rlimit bound{limit, limit};
                ::setrlimit(RLIMIT_FSIZE, &bound);
                int code = 2;
                try {
                    writer();
                } catch (const image_io::WriteError &error) {
                    code = std::string(error.what()).find(target) == 0 ? 0 : 3;
                } catch (...) {
                    code = 1;
                }
                ::_exit(code);
            }
            int status = 0;
            ASSERT_EQ(::waitpid(child, &status, 0), child);
            EXPECT_TRUE(WIFEXITED(status)) << name << ", limit " << limit;
            EXPECT_EQ(WEXITSTATUS(status), 0) << name << ", limit " << limit;
            EXPECT_EQ(file_count(), 0) << name << ", limit " << limit;
        }
    }
}

} // namespace
