// The registry of image formats: every record is whole, and one more file in its folder is one more format.
#include "io/formats.hpp"
#include "io/openexr.hpp"

#include <gtest/gtest.h>

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <set>

namespace image_io::format_files {
Format toy();
} // namespace image_io::format_files

namespace {

namespace fs = std::filesystem;
using image_io::Format;

std::string refused(const std::string &path, const image_io::ReadRequest &request = {}) {
    try {
        (void)image_io::open(path, request);
    } catch (const image_io::ReadError &error) {
        return error.what();
    }
    return "";
}

class Formats : public ::testing::Test {
  protected:
    void SetUp() override { fs::create_directory(folder_); }
    void TearDown() override { fs::remove_all(folder_); }
    std::string file(const std::string &name, const std::string &content) const {
        image_io::write_text((folder_ / name).string(), content);
        return (folder_ / name).string();
    }

    fs::path folder_ = fs::temp_directory_path() / ("clspeckle-formats-" + std::to_string(::getpid()));
};

TEST_F(Formats, EveryFileOfTheFolderIsAFormatWithAWholeRecord) {
    std::size_t files = 0;
    for (const auto &entry : fs::directory_iterator(fs::path(CLSP_SOURCE_DIR) / "io" / "formats"))
        files += entry.path().extension() == ".cpp" ? 1 : 0;
    EXPECT_EQ(image_io::formats().size(), files);
    std::set<std::string> told; // names, endings, first bytes and words are told once
    std::set<int> places;
    for (const Format &format : image_io::formats()) {
        EXPECT_TRUE(places.insert(format.place).second) << format.name;
        EXPECT_TRUE(told.insert(format.name).second) << format.name;
        ASSERT_FALSE(format.extensions.empty()) << format.name;
        for (const std::string &extension : format.extensions) {
            EXPECT_EQ(extension[0], '.');
            EXPECT_TRUE(told.insert(extension).second) << extension;
            EXPECT_EQ(image_io::format_of_extension("a.b/IMAGE" + extension), &format);
        }
        for (const std::string &magic : format.magic)
            EXPECT_TRUE(told.insert(magic).second) << format.name;
        EXPECT_EQ(format.create != nullptr, !format.writes.empty()) << format.name;
        EXPECT_FALSE(format.codes == image_io::Codes::stacks && format.stacks.empty()) << format.name;
        for (const image_io::FrameStorage &storage : format.storage) {
            EXPECT_TRUE(told.insert(storage.word).second) << storage.word;
            EXPECT_EQ(storage.word.rfind("float-", 0) == 0, storage.sample == image_io::Sample::float32);
            EXPECT_TRUE(!storage.stack || !format.stacks.empty()) << storage.word;
            EXPECT_EQ(std::count(format.writes.begin(), format.writes.end(), storage.sample), 1) << storage.word;
        }
    }
}

TEST_F(Formats, ErrorsNameWhatIsReadHere) {
    const std::string text = file("a.png", "no image"), exr = file("a.exr", "\x76\x2f\x31\x01 and more");
    EXPECT_NE(refused(text).find(
                  "is not a PNG, TIFF, EXR, Radiance HDR, NPY, PNM, JPEG, BMP, TGA or raw file (the content decides"),
              std::string::npos);
    EXPECT_NE(refused(exr).find("of the format EXR, which is not read here; PNG, TIFF, Radiance HDR, NPY, PNM, "
                               "JPEG, BMP, TGA and raw are"),
              std::string::npos);
    image_io::add_openexr();
    EXPECT_NE(refused(exr).find("a.exr: is truncated"), std::string::npos);
    const std::string pgm = file("b.pgm", "P5 1 1 255 x");
    EXPECT_EQ(refused(pgm, {"Y"}), "");
    EXPECT_EQ(refused(pgm + ":Y"), "");
    EXPECT_NE(refused(pgm + ":Z").find("b.pgm: has no channel \"Z\"; its channels are: Y"), std::string::npos);
    EXPECT_NE(refused(pgm + ":Y", {"Z"}).find("two channels are named"), std::string::npos);
    EXPECT_THROW(image_io::create((folder_ / "c.hdr").string(), image_io::format_named("Radiance HDR"), {}),
                 image_io::WriteError);
}

TEST_F(Formats, TheRecipeAddsAFormat) {
    EXPECT_EQ(image_io::format_of_extension("image.toy"), nullptr);
    image_io::add_format(image_io::format_files::toy());
    const Format &toy = image_io::format_named("TOY");
    EXPECT_EQ(image_io::format_of_extension("image.Toy"), &toy);
    EXPECT_EQ(image_io::listed("or", [](const Format &f) { return f.codes == image_io::Codes::frames; }),
              "PNG, TIFF, PNM, BMP, TGA, raw or TOY");
    const std::vector<std::uint8_t> codes = {0, 1, 2, 253, 254, 255};
    const std::string path = (folder_ / "named_wrongly.png").string();
    image_io::write(path, toy, 3, 2, codes.data());
    const auto reader = image_io::open(path);
    EXPECT_EQ(reader->info().format, &toy);
    std::vector<std::string> warnings;
    const image_io::Plane plane = image_io::read_gray(*reader, 0, warnings);
    EXPECT_EQ(std::vector<std::uint8_t>(plane.values.begin(), plane.values.end()), codes);
    EXPECT_NE(refused(file("b.toy", "TOY\x03")).find("is truncated"), std::string::npos);
    EXPECT_NE(refused(file("c.toy", "another")).find("TGA, raw or TOY file"), std::string::npos);
}

} // namespace
