/**
 * @file text.hpp
 * @brief Text for eyes.
 */
#ifndef CLSPECKLE_TOOLS_TEXT_HPP
#define CLSPECKLE_TOOLS_TEXT_HPP

#include <cstddef>
#include <string>
#include <vector>

namespace tools {

/** Columns of text, left-aligned, the first row as header. */
std::string table(const std::vector<std::vector<std::string>> &rows, const std::string &indent = "");

/** "0.25 %": two digits behind the point, or as many as show that it is not 0. */
std::string percent(double share);

/** Words with commas, and `last` before the last one: " and ". */
std::string joined(const std::vector<std::string> &words, const char *last);

/** Words broken into lines that begin with an indent. */
std::string wrapped(const std::string &text, const std::string &indent, std::size_t width = 110);

/** How many letters must be added, removed or replaced to make one word of the other. */
std::size_t edit_distance(const std::string &a, const std::string &b);

/** The candidate with the smallest edit distance to `word`. */
std::string nearest(const std::string &word, const std::vector<std::string> &candidates);

/**
 * "; the nearest one is ...", if `word` may be a slip of it: its beginning, or a third of its letters are others at
 * most. Else nothing.
 */
std::string suggestion(const std::string &word, const std::vector<std::string> &candidates, bool quoted = true);

} // namespace tools

#endif // CLSPECKLE_TOOLS_TEXT_HPP
