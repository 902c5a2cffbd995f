/**
 * @file series.hpp
 * @brief Which files of a folder are the images of one series: their names differ in numbers alone.
 */
#ifndef CLSPECKLE_IO_SERIES_HPP
#define CLSPECKLE_IO_SERIES_HPP

#include "io/formats.hpp"

#include <string>
#include <vector>

namespace image_io {

/** frame2 before frame10: runs of digits compare as numbers, with the sign that begins a name. */
bool natural_less(const std::string &a, const std::string &b);

/** What a glob pattern takes as it stands. */
std::string literal_pattern(const std::string &text);

/** Whether a name holds what a glob pattern gives a meaning. */
bool is_pattern(const std::string &name);
/** The files that match a glob pattern; none: none does. */
std::vector<std::string> matches_of(const std::string &pattern);

/** FOLDER:CHANNEL and PATTERN:CHANNEL taken apart, as split_name() does it with files; a pattern that files match goes
 * first. */
ImageName split_several(const std::string &name);

/** A preview that render wrote beside its frames: an image for the eye, with 8-bit values of its own. */
bool is_preview(const std::string &path);

/** Leaves previews out, unless there is nothing else. */
void leave_previews_out(std::vector<std::string> &paths);

struct Series {
    std::string pattern;            ///< A glob pattern of names that all its files match, and no other one.
    std::vector<std::string> names; ///< In natural order.
};

/**
 * The series of a folder's names, the largest one first. Two numbers that go through all pairs of their values
 * (cam0_0001, cam1_0001 ...) are several series of the one with fewer values.
 */
std::vector<Series> series_of(const std::vector<std::string> &names);

/**
 * Why the files of a folder are no frames of one scene, and what to name instead; empty where they are.
 * @param folder as the input names it.
 * @param before what a pattern is named with, such as a quote and the path of the folder; behind: after it.
 */
std::string why_no_series(const std::string &folder, const std::vector<std::string> &paths, const std::string &before,
                          const std::string &behind);

/**
 * Numbers that the names of a series skip, in words: a grabber has dropped frames, or a file was lost. Empty where all
 * are there, and where names are no numbering (time stamps skip more than half).
 */
std::string missing_numbers(const std::vector<std::string> &paths);

/**
 * That the names of a series count through by their last number, and stand in another order, in words: a shell sorts 10
 * before 2, and another number that varies goes first. Empty where they stand as they count, or backwards.
 */
std::string counted_otherwise(const std::vector<std::string> &paths);

/** That files that are named one by one are several series by their names, in words; empty: they are one. */
std::string several_series(const std::vector<std::string> &paths);

} // namespace image_io

#endif // CLSPECKLE_IO_SERIES_HPP
