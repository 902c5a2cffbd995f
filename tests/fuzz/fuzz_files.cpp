// Any bytes as one of the files that are no images: what they mean, or an error with the file's name; nothing else, and
// no stray access.
//
// With libFuzzer: fuzz_files CORPUS... --kind=capture. Without it (replay.cpp): the files named are read once
// each.
#include "capture.hpp"
#include "capture/capture_check.hpp"
#include "capture/capture_json.hpp"
#include "capture/capture_reader.hpp"
#include "console.hpp"
#include "depth.hpp"
#include "doe/doe_cache.hpp"
#include "doe_files.hpp"
#include "errors.hpp"
#include "fft/plan/tuning_record.hpp"
#include "hypothesis_file.hpp"
#include "input.hpp"
#include "io/json_file.hpp"
#include "measure/acceptance.hpp"
#include "report/profile_json.hpp"
#include "runtime/error.hpp"
#include "runtime/program_file.hpp"
#include "simulator/source_includes.hpp"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <functional>
#include <map>
#include <string>

namespace {

namespace fs = std::filesystem;

constexpr const char *program_head = "clspeckle-program-2\nhead\n";
const std::string pattern_key = "0123456789abcdef0123456789abcdef";

void write_file(const fs::path &path, const std::string &bytes) {
    std::FILE *stream = std::fopen(path.c_str(), "wb");
    if (!stream || std::fwrite(bytes.data(), 1, bytes.size(), stream) != bytes.size() || std::fclose(stream) != 0)
        std::abort();
}

/** A folder of this user's own, with what the files may name: f.npy and f.cl. */
const fs::path &folder() {
    static const fs::path path = [] {
        std::string name = (fs::is_directory("/dev/shm") ? "/dev/shm" : fs::temp_directory_path().string()) +
                           std::string("/clspeckle-fuzz-XXXXXX");
        if (!::mkdtemp(name.data()))
            std::abort();
        std::string npy("\x93NUMPY\x01\x00", 8);
        std::string header = "{'descr': '<f4', 'fortran_order': False, 'shape': (4, 4), }";
        header.resize(117, ' ');
        npy += std::string("\x76\x00", 2) + header + "\n" + std::string(64, '\0');
        write_file(name + "/f.npy", npy);
        write_file(name + "/f.cl", "float hypothesis();");
        std::atexit([] {
            std::error_code ignored;
            fs::remove_all(folder(), ignored);
        });
        return fs::path(name);
    }();
    return path;
}

/** Puts files into a folder: the text between lines "%%% NAME", which mutations take apart and together. */
fs::path folder_of_files(const std::string &bytes) {
    constexpr std::size_t most_files = 12, most_name = 24;
    const std::string mark = "%%% ";
    const fs::path result = folder() / "set";
    fs::remove_all(result);
    fs::create_directories(result);
    std::size_t at = bytes.find(mark);
    for (std::size_t files = 0; files < most_files && at != std::string::npos; ++files) {
        const std::size_t end = std::min(bytes.find('\n', at), bytes.size());
        const std::string name = bytes.substr(at + mark.size(), std::min(end - at - mark.size(), most_name + 1));
        at = bytes.find("\n" + mark, end);
        const std::string content = end < bytes.size() ? bytes.substr(end + 1, at - end - 1) : "";
        at += at == std::string::npos ? 0 : 1;
        if (!name.empty() && name.size() <= most_name && name.find('/') == std::string::npos && name[0] != '.' &&
            name.find('\0') == std::string::npos)
            write_file(result / name, content);
    }
    return result;
}

void ignoring_errors(const std::function<void()> &work) {
    try {
        work();
    } catch (const clsp::Error &) {
    } catch (const tools::InputError &) {
    } catch (const image_io::ReadError &) {
    }
}

/** What each kind of file is read by. `path`: the file, with the kind's ending. */
struct Kind {
    const char *name;
    std::function<void(const std::string &path, const std::string &bytes)> read;
};

const std::map<std::string, Kind> kinds = {
    {"json",
     {"file.json",
      [](const std::string &path, const std::string &) { (void)image_io::shown(image_io::read_json(path).root()); }}},
    {"capture", {"file.json", [](const std::string &path, const std::string &) { clsp::read_capture_json(path); }}},
    // A capture set with frames and masks; then what `capture init` makes of the same files.
    {"set",
     {"files",
      [](const std::string &, const std::string &bytes) {
          const fs::path set = folder_of_files(bytes);
          ignoring_errors([&] { (void)clsp::capture_summary_json(clsp::read_capture(set.string())); });
          ignoring_errors([&] {
              tools::CaptureInitArguments arguments;
              arguments.folder = set.string();
              arguments.raw = "16x12,16";
              arguments.force = true;
              tools::Console console(false, true);
              tools::run_capture_init(arguments, console);
              (void)clsp::read_capture(set.string());
          });
      }}},
    {"profile", {"file.json", [](const std::string &path, const std::string &) { clsp::read_profile(path); }}},
    {"tolerance", {"file.json", [](const std::string &path, const std::string &) { clsp::read_tolerances(path); }}},
    {"tuning",
     {"tuning.json",
      [](const std::string &path, const std::string &) {
          const clsp::TuningFile file = clsp::load_tuning(path);
          if (file.records.empty())
              return;
          clsp::tuned_choices(file, file.records[0].device, true, 640, 480, "it");
          clsp::parse_tuning(clsp::tuning_json(file));
      }}},
    {"configuration",
     {"file.json",
      [](const std::string &path, const std::string &) {
          tools::Config config;
          config.load(path);
          config.settle();
          (void)config.dump();
      }}},
    {"sequence",
     {"sequence.json",
      [](const std::string &path, const std::string &) {
          tools::Config config;
          tools::InputPaths paths;
          paths.inputs = {path};
          const auto input = tools::open_input(paths, config);
          std::vector<std::string> warnings;
          if (input->frame_count > 0)
              input->read(0, warnings);
      }}},
    {"dots", {"file.json", [](const std::string &path, const std::string &) { tools::read_dots(path, 2.0); }}},
    {"directions",
     {"file.txt",
      [](const std::string &path, const std::string &) {
          tools::projected(tools::read_directions(path), CLSP_PROJECTION_TANGENT_PLANE, path);
      }}},
    {"geometry",
     {"file.json",
      [](const std::string &path, const std::string &) {
          auto desc = clspeckle::make<ClspDepthDesc>();
          tools::read_geometry(path, desc);
      }}},
    {"design",
     {"f.json",
      [](const std::string &path, const std::string &) {
          tools::Console console(false, true);
          tools::read_design((folder() / "f.npy").string(), console);
          tools::read_direction_cosines(path);
      }}},
    {"hypothesis", {"file.json", [](const std::string &path, const std::string &) { tools::read_hypothesis(path); }}},
    {"source",
     {"file.cl",
      [](const std::string &, const std::string &bytes) {
          // What is plain is found whatever stands behind it, and before it but for an open comment or a joined line.
          const bool open = bytes.find_first_of("*\\?") != std::string::npos;
          if ((!open && clsp::word_that_reads_files(bytes + "\n#include \"a\"\n").empty()) ||
              clsp::word_that_reads_files("#include \"a\"\n" + bytes).empty())
              std::abort();
      }}},
    {"program",
     {"file.clbin",
      [](const std::string &, const std::string &) {
          clsp::CacheFolder::File file =
              clsp::CacheFolder(folder().string(), [](const std::string &) {}).open("file.clbin");
          const auto binary = clsp::read_program_file(file, program_head);
          if (binary && binary->size() >= file.size())
              std::abort();
      }}},
    {"pattern",
     {"0123456789abcdef0123456789abcdef.doe",
      [](const std::string &, const std::string &) {
          const auto result =
              clsp::load_doe_pattern(clsp::CacheFolder(folder().string(), [](const std::string &) {}), pattern_key);
          if (result && result->texels.size() != std::size_t{result->budget.image_width} * result->budget.image_height)
              std::abort();
      }}},
};

const Kind *kind = nullptr;

/** Whole files of a cache, which no script writes. */
void write_cache_files(const fs::path &to) {
    clsp::DoePatternResult result;
    result.budget.image_width = 3;
    result.budget.image_height = 2;
    result.texels.assign(6, 0.5f);
    result.dot_shares.assign(2, 0.25);
    fs::create_directories(to / "pattern");
    fs::permissions(to / "pattern", fs::perms::owner_all);
    clsp::store_doe_pattern(clsp::CacheFolder((to / "pattern").string(), [](const std::string &) {}), pattern_key,
                            result);
    fs::create_directories(to / "program");
    image_io::AtomicFile file((to / "program" / "whole").string());
    clsp::write_program_file(file, program_head, "a binary");
    file.commit();
}

} // namespace

extern "C" int LLVMFuzzerInitialize(int *argc, char ***argv) {
    for (int i = 1; i < *argc; ++i) {
        const std::string word = (*argv)[i];
        if (word.rfind("--kind=", 0) == 0)
            kind = &kinds.at(word.substr(7));
        if (word.rfind("--seeds=", 0) == 0) {
            write_cache_files(word.substr(8));
            std::exit(0);
        }
    }
    if (!kind)
        std::abort();
    return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const unsigned char *data, std::size_t size) {
    const std::string bytes(reinterpret_cast<const char *>(data), size);
    const fs::path path = folder() / kind->name;
    write_file(path, bytes);
    fs::permissions(path, fs::perms::owner_read | fs::perms::owner_write);
    try {
        kind->read(path.string(), bytes);
    } catch (const clsp::Error &) {
    } catch (const clspeckle::Error &) {
    } catch (const tools::InputError &) {
    } catch (const image_io::ReadError &) {
    }
    return 0;
}
