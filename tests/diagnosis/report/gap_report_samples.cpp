// Writes sample reports: gap_report_samples FOLDER. test_report_html.py reads them.
#include "diagnosis/report/sample_reports.hpp"
#include "report/report_html.hpp"
#include "report/report_json.hpp"

#include <cstdio>
#include <exception>
#include <fstream>

int main(int argc, char **argv) {
    if (argc != 2) {
        std::fprintf(stderr, "usage: gap_report_samples FOLDER\n");
        return 2;
    }
    try {
        for (const auto &[name, result] : sample::reports(clsp::Context::create({}))) {
            std::ofstream file(std::string(argv[1]) + "/" + name + ".html", std::ios::binary);
            file << clsp::report_html(result);
            if (!file.flush()) {
                std::fprintf(stderr, "%s/%s.html cannot be written\n", argv[1], name.c_str());
                return 1;
            }
            std::printf("%s\n", name.c_str());
        }
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
    return 0;
}
