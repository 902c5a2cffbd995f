/**
 * @file picture.hpp
 * @brief Pictures for eyes: pixels in color, with axes, scales and legends.
 */
#ifndef CLSPECKLE_TOOLS_PICTURE_HPP
#define CLSPECKLE_TOOLS_PICTURE_HPP

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace tools {

using Color = std::array<std::uint8_t, 3>;

constexpr Color black = {0, 0, 0};

/** Matplotlib's viridis. @param t 0 to 1; what is beyond takes the nearest. */
Color viridis(double t);

/** Where ticks stand: 1, 2 or 5 times a power of ten apart, about `wanted` of them. */
std::vector<double> ticks(double low, double high, int wanted = 5);

/** What an axis says. @param low,high its values at the picture's left or top, and at its right or bottom. */
struct Axis {
    double low, high;
    std::string label;
};

/** Where something lies in a picture: pixels from its top left corner. */
struct Box {
    int x, y, width, height;
};

class Picture {
  public:
    /** White. */
    Picture(int width, int height);

    /** What lies outside is left out. */
    void set(int x, int y, Color color);
    void fill(Box box, Color color);
    /** A frame of one pixel around the box. */
    void outline(Box box, Color color);
    /** One line of ASCII. @param align 0: from x on, 0.5: around x, 1: up to x. y is its top. */
    void text(double x, double y, const std::string &line, Color color = black, double align = 0);
    /** Frame, ticks and labels around a box; they take margins (left, top, right, bottom) of it. */
    void axes(Box box, const Axis &horizontal, const Axis &vertical);
    /** A bar of colors with ticks at its right, its high end on top. @param place where a value stands, 0 to 1. */
    void bar(Box box, const Axis &values, const std::function<double(double)> &place);
    /** Throws image_io::WriteError. */
    void write(const std::string &path) const;

    static constexpr int line_height = 22;
    static constexpr int left_margin = 110, top_margin = 40, bottom_margin = 60, bar_width = 150;

  private:
    int width_, height_;
    std::vector<std::uint8_t> pixels_;
};

} // namespace tools

#endif // CLSPECKLE_TOOLS_PICTURE_HPP
