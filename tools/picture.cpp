#include "picture.hpp"

#include "io/atomic_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <new>

#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STB_IMAGE_WRITE_STATIC
#define STBI_WRITE_NO_STDIO
#include <stb/stb_easy_font.h>
#include <stb/stb_image_write.h>

namespace tools {

namespace {

constexpr double text_scale = 2;
constexpr int tick_length = 6;

struct Vertex {
    float x, y, z;
    unsigned char color[4];
};

} // namespace

Color viridis(double t) {
    constexpr double anchors[][3] = {{68, 1, 84},    {72, 40, 120},  {62, 74, 137},  {49, 104, 142}, {38, 130, 142},
                                     {31, 158, 137}, {53, 183, 121}, {110, 206, 88}, {181, 222, 43}, {253, 231, 37}};
    constexpr std::size_t last = std::size(anchors) - 1;
    const double at = std::clamp(t, 0.0, 1.0) * last;
    const std::size_t i = std::min(static_cast<std::size_t>(at), last - 1);
    Color color;
    for (std::size_t c = 0; c < 3; ++c)
        color[c] = static_cast<std::uint8_t>(
            std::lround(anchors[i][c] + (at - static_cast<double>(i)) * (anchors[i + 1][c] - anchors[i][c])));
    return color;
}

std::vector<double> ticks(double low, double high, int wanted) {
    if (!(high > low))
        return {low};
    const double rough = (high - low) / wanted, power = std::pow(10, std::floor(std::log10(rough)));
    double step = 10 * power;
    for (const double factor : {5.0, 2.0, 1.0})
        if (factor * power >= rough * 0.75)
            step = factor * power;
    std::vector<double> values;
    for (double k = std::ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k)
        values.push_back(k == 0 ? 0.0 : k * step);
    return values;
}

Picture::Picture(int width, int height)
    : width_(width), height_(height),
      pixels_(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 255) {}

void Picture::set(int x, int y, Color color) {
    if (x >= 0 && y >= 0 && x < width_ && y < height_)
        std::copy(color.begin(), color.end(),
                  &pixels_[3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
                                static_cast<std::size_t>(x))]);
}

void Picture::fill(Box box, Color color) {
    for (int y = box.y; y < box.y + box.height; ++y)
        for (int x = box.x; x < box.x + box.width; ++x)
            set(x, y, color);
}

void Picture::outline(Box box, Color color) {
    fill({box.x, box.y, box.width, 1}, color);
    fill({box.x, box.y + box.height - 1, box.width, 1}, color);
    fill({box.x, box.y, 1, box.height}, color);
    fill({box.x + box.width - 1, box.y, 1, box.height}, color);
}

void Picture::text(double x, double y, const std::string &line, Color color, double align) {
    std::string copy = line; // the font takes no const
    std::vector<Vertex> corners(80 * copy.size() + 4);
    const int quads =
        stb_easy_font_print(0, 0, &copy[0], nullptr, corners.data(), static_cast<int>(corners.size() * sizeof(Vertex)));
    const double left = std::round(x - align * text_scale * stb_easy_font_width(&copy[0]));
    for (int q = 0; q < quads; ++q) {
        const Vertex &begin = corners[static_cast<std::size_t>(4 * q)],
                     &end = corners[static_cast<std::size_t>(4 * q + 2)];
        const auto at = [](double origin, float value) {
            return static_cast<int>(std::lround(origin + text_scale * value));
        };
        fill({at(left, begin.x), at(y, begin.y), static_cast<int>(text_scale * (end.x - begin.x)),
              static_cast<int>(text_scale * (end.y - begin.y))},
             color);
    }
}

void Picture::axes(Box box, const Axis &horizontal, const Axis &vertical) {
    outline({box.x - 1, box.y - 1, box.width + 2, box.height + 2}, black);
    for (const double value : ticks(horizontal.low, horizontal.high)) {
        const double x = box.x + (value - horizontal.low) / (horizontal.high - horizontal.low) * box.width;
        fill({static_cast<int>(x), box.y + box.height, 1, tick_length}, black);
        text(x, box.y + box.height + tick_length + 3, fmt::format("{:.6g}", value), black, 0.5);
    }
    text(box.x + box.width / 2.0, box.y + box.height + tick_length + line_height + 3, horizontal.label, black, 0.5);
    for (const double value : ticks(vertical.low, vertical.high)) {
        const double y = box.y + (value - vertical.low) / (vertical.high - vertical.low) * box.height;
        fill({box.x - tick_length, static_cast<int>(y), tick_length, 1}, black);
        text(box.x - tick_length - 4, y - 7, fmt::format("{:.6g}", value), black, 1);
    }
    text(box.x - tick_length - 4, box.y - line_height - 6, vertical.label, black, 0.5);
}

void Picture::bar(Box box, const Axis &values, const std::function<double(double)> &place) {
    for (int y = 0; y < box.height; ++y)
        fill({box.x, box.y + y, box.width, 1}, viridis(1 - (y + 0.5) / box.height));
    outline({box.x - 1, box.y - 1, box.width + 2, box.height + 2}, black);
    for (const double value : ticks(values.low, values.high)) {
        const double y = box.y + (1 - place(value)) * box.height;
        fill({box.x + box.width, static_cast<int>(y), tick_length, 1}, black);
        text(box.x + box.width + tick_length + 4, y - 7, fmt::format("{:.4g}", value));
    }
    text(box.x, box.y - line_height - 6, values.label);
}

void Picture::write(const std::string &path) const {
    int size = 0;
    const std::unique_ptr<unsigned char, void (*)(void *)> png(
        stbi_write_png_to_mem(pixels_.data(), 3 * width_, width_, height_, 3, &size), std::free);
    if (!png)
        throw std::bad_alloc();
    image_io::AtomicFile file(path);
    file.write(png.get(), static_cast<std::size_t>(size));
    file.commit();
}

} // namespace tools
