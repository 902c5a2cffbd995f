/**
 * @file options.hpp
 * @brief The one table of render options, and a configuration made from it.
 *
 * From the table come the keys of the JSON configuration, the command line options of the same name, their help texts
 * and all checks. Defaults are those of the C interface's init functions.
 */
#ifndef CLSPECKLE_TOOLS_OPTIONS_HPP
#define CLSPECKLE_TOOLS_OPTIONS_HPP

#include "effects.hpp"
#include "io/image_io.hpp"

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace tools {

enum class Kind {
    boolean,
    integer, ///< Or one of the words, if there are any.
    number,  ///< Or one of the words, if there are any; "inf" where that is the default.
    choice,  ///< One of the words.
    text,
    file,    ///< A path, relative to the configuration file that names it; "" for none.
    numbers, ///< A list; its length is one of `counts`.
};

struct Option {
    std::string section;
    std::string key;
    Kind kind = Kind::text;
    Json fallback;
    std::string unit;
    double low = 0.0; ///< Of numbers; those between are taken.
    double high = 0.0;
    std::vector<std::string> words;
    std::vector<std::size_t> counts;
    std::string help;
    std::string name;  ///< On the command line, without the dashes.
    std::string alias; ///< The name without its unit, where that is unique; else empty.

    std::string id() const { return section + "." + key; }
    /** For example "0 to 1", "none, all or mask". */
    std::string range() const;
};

/** Of the option --channel of commands that measure images. */
std::string channel_help();
/** Of their option --raw. */
std::string raw_help();

/** What render.transfer says. */
image_io::Encoding encoding_of(const class Config &config);

/** All options, in the order in which they are shown. */
const std::vector<Option> &option_table();
/** The option of "section.key"; it must exist. */
const Option &option(const std::string &id);

/** Where a value comes from; a later one beats an earlier one. */
enum class Layer { fallback, sequence, file, profile, command_line };

/** Effective values of all options. */
class Config {
  public:
    Config();

    /** Sets a value unless a later layer has set it. @param where for messages, for example "--f-number". */
    void set(const Option &option, const Json &value, Layer layer, const std::string &where);
    /** The same from text, as the command line gives it. */
    void set_text(const Option &option, const std::string &text, Layer layer, const std::string &where);
    /** Reads a JSON configuration. Throws InputError naming the nearest known key for an unknown one. */
    void load(const std::string &path);
    /**
     * Takes a camera profile over. Later values of the command line replace its own, which replaced() tells; but for
     * what its effects were measured with. What a configuration or a scene says otherwise is refused.
     * @param sequence whose light, scene and motion are rendered; empty: none's.
     * @param maps whether its maps are used, in the place of the effects that they hold.
     * @return what of the profile is left out, and why.
     */
    std::vector<std::string> load_profile(const std::string &path, const std::string &sequence, bool maps);
    /** What of the effects that are on comes on top of a profile's map that holds such a pattern, in words. */
    std::vector<std::string> doubled() const;
    /** Refuses an image of another size than the profile's. */
    void check_image(std::uint32_t width, std::uint32_t height, const std::string &name) const;
    /** Once the command line is read: throws where the configuration and the profile give a setting two values and the
     * command line gives none. */
    void check_conflicts() const;
    /** What the command line has in the place of the profile's values, in words. */
    const std::vector<std::string> &replaced() const { return replaced_; }
    /** The profile's file; empty without one. */
    const std::string &profile() const { return profile_; }

    /** Switches an effect on, or changes it. */
    void set_effect(const EffectSetting &setting, Layer layer);
    void clear_effects();
    /** Those that are on, in the order of the catalogue. */
    std::vector<EffectSetting> effects() const;
    /** Settles what depends on several options: a later f-number, pixel pitch or wavelength replaces an earlier
     * diameter; what a sensor's profile says replaces what was said before it; a motion replaces the refresh mask. */
    void settle();

    Json dump() const;

    bool flag(const std::string &id) const { return value(id).get<bool>(); }
    std::uint64_t integer(const std::string &id) const { return value(id).get<std::uint64_t>(); }
    double number(const std::string &id) const;
    std::string text(const std::string &id) const { return value(id).get<std::string>(); }
    std::vector<double> numbers(const std::string &id) const { return value(id).get<std::vector<double>>(); }
    /** True if a number or an integer is one of its words, for example "auto". */
    bool is_word(const std::string &id) const { return value(id).is_string() && value(id) != "inf"; }
    /** Index of a choice among its words: the value of the C constant. */
    std::uint32_t choice(const std::string &id) const;
    Layer layer(const std::string &id) const { return entries_.at(id).layer; }
    /** Replaces a value by what it turned out to be. */
    void resolve(const std::string &id, const Json &value) { entries_.at(id).value = value; }

  private:
    void settle_sensor();
    struct Entry {
        Json value;
        Layer layer = Layer::fallback;
    };
    struct EffectEntry {
        EffectSetting setting;
        Layer layer = Layer::fallback;
    };
    const Json &value(const std::string &id) const { return entries_.at(id).value; }
    /** Two values of one setting, one of them the profile's. */
    void contradict(const Option &option, const Entry &entry, const Json &value, Layer layer, const std::string &where);
    std::map<std::string, Entry> entries_;
    std::map<std::string, EffectEntry> effects_;
    std::string profile_;
    std::uint32_t profile_width_ = 0;
    std::uint32_t profile_height_ = 0;
    std::vector<std::string> replaced_;
    std::map<std::string, std::string> conflicts_; ///< Of the configuration with the profile, in words, by setting.
    std::map<std::string, std::string> held_; ///< Effects that a map of the profile holds, with its option.
};

} // namespace tools

#endif // CLSPECKLE_TOOLS_OPTIONS_HPP
