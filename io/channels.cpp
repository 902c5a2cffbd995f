#include "io/channels.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <iterator>
#include <map>

namespace image_io {

namespace {

using Names = std::vector<std::string>;

std::string joined(const Names &names) {
    std::string text;
    for (const std::string &name : names)
        text += (text.empty() ? "" : ", ") + name;
    return text;
}

/** Letters and digits in lower case: "Z_Depth" and "zdepth" are one word. */
std::string word_of(const std::string &name) {
    std::string word;
    for (const char c : name)
        if (std::isalnum(static_cast<unsigned char>(c)))
            word += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return word;
}

std::string layer_of(const std::string &channel) {
    const std::size_t dot = channel.find_last_of('.');
    return dot == std::string::npos ? "" : channel.substr(0, dot);
}
std::string tail_of(const std::string &name) {
    return name.substr(name.find_last_of('.') + 1); // npos + 1 is 0
}

bool contains(const Names &names, const std::string &name) {
    return std::find(names.begin(), names.end(), name) != names.end();
}

/** A file's layers; those without a name are one, "". */
class Layers {
  public:
    explicit Layers(const Names &channels) : channels_(channels) {
        for (const std::string &channel : channels)
            if (!contains(names_, layer_of(channel)))
                names_.push_back(layer_of(channel));
    }

    const Names &names() const { return names_; }
    /** The channel of a layer, whatever the case of its last letter; empty if there is none. */
    std::string channel(const std::string &layer, const std::string &tail) const {
        for (const std::string &channel : channels_)
            if (layer_of(channel) == layer && word_of(tail_of(channel)) == word_of(tail))
                return channel;
        return "";
    }
    /** The three of a layer, or none. */
    Names triple(const std::string &layer, const char *tails) const {
        Names found;
        for (; *tails; ++tails)
            if (const std::string name = channel(layer, std::string(1, *tails)); !name.empty())
                found.push_back(name);
        return found.size() == 3 ? found : Names{};
    }
    Names picture(const std::string &layer) const {
        const std::string y = channel(layer, "Y");
        // Y beside X is a vector's.
        if (!y.empty() && channel(layer, "X").empty())
            return {y};
        return triple(layer, "RGB");
    }
    /** All of a layer but its opacity. */
    Names opaque(const std::string &layer) const {
        Names found;
        for (const std::string &channel : channels_)
            if (layer_of(channel) == layer && tail_of(channel) != "A")
                found.push_back(channel);
        return found;
    }

  private:
    const Names &channels_;
    Names names_;
};

bool is_vector(Role role) {
    return role == Role::position || role == Role::normal;
}

const char *said(Role role) {
    switch (role) {
    case Role::depth:
        return "a depth (Z, or one channel of a layer that is named for depth)";
    case Role::position:
        return "a position (X, Y, Z of a layer P or Position)";
    case Role::normal:
        return "a normal (X, Y, Z of a layer N or Normal)";
    case Role::albedo:
        return "an albedo";
    case Role::visibility:
        return "a visibility";
    case Role::mask:
        return "a mask";
    case Role::material:
        return "materials";
    case Role::map:
        return "a map (one channel)";
    default:
        return "a picture (Y, or R, G, B)";
    }
}

/** Depths of other numbers than metres, and what is said about a depth. */
constexpr const char *not_metres[] = {"inv", "dispar", "norm", "mist", "fog", "conf", "varian", "error", "weight"};

/** What a layer or a lone channel of the role is called. */
bool fits(Role role, const std::string &name) {
    const std::string word = word_of(tail_of(name));
    const auto is = [&](std::initializer_list<const char *> words) {
        return std::any_of(words.begin(), words.end(), [&](const char *one) { return word == one; });
    };
    switch (role) {
    case Role::depth:
        return is({"z", "zbuffer"}) || word.find("depth") != std::string::npos;
    case Role::position:
        return is({"p", "pos", "position"});
    case Role::normal:
        return is({"n", "normal", "normals"});
    case Role::albedo:
        return is({"albedo", "diffcol", "diffusecolor", "basecolor"});
    case Role::visibility:
        return is({"visibility"});
    case Role::mask:
        return is({"refresh", "mask"});
    case Role::material:
        return is({"material", "materialid", "indexma"});
    default:
        return is({"combined", "beauty", "rgba", "rgb", "color", "image"});
    }
}

/** The layer's own name, without the view of a pair of cameras that it belongs to ("Depth.left"). */
std::string without_view(const std::string &layer) {
    const std::string view = word_of(tail_of(layer));
    return view == "left" || view == "right" ? layer_of(layer) : layer;
}

/** Whether what a layer or a channel is called may be metres along the optical axis. */
bool may_be_metres(const std::string &name) {
    const std::string word = word_of(name);
    return std::none_of(std::begin(not_metres), std::end(not_metres),
                        [&](const char *one) { return word.find(one) != std::string::npos; });
}

/** Whether the only channel, or Z, of a layer of this name is a depth: other layers keep mist or light there. */
bool keeps_depth(const std::string &layer) {
    const std::string own = without_view(layer), word = word_of(tail_of(own));
    return own.empty() || (may_be_metres(tail_of(own)) &&
                           (fits(Role::depth, own) || word == "range" || word.find("distance") != std::string::npos));
}

/** Whether a channel's names say that it is something else. */
bool is_named_as_another(const std::string &channel, Role role) {
    for (const Role other : {Role::depth, Role::position, Role::normal, Role::albedo, Role::visibility, Role::mask,
                             Role::material, Role::image})
        if (other != role && (fits(other, layer_of(channel)) || fits(other, tail_of(channel))))
            return true;
    return false;
}

/** Those of a layer that the role takes. */
Names of_layer(const Layers &layers, const std::string &layer, Role role) {
    if (is_vector(role)) {
        const Names vector = layers.triple(layer, "XYZ");
        return vector.empty() ? layers.triple(layer, "RGB") : vector;
    }
    const Names opaque = layers.opaque(layer);
    if (opaque.size() == 1)
        return opaque;
    if (role == Role::depth && layers.channel(layer, "X").empty())
        for (const char *tail : {"Z", "V", "depth"})
            if (const std::string channel = layers.channel(layer, tail); !channel.empty())
                return {channel};
    return layers.picture(layer);
}

/** What fits, the best first: the first of the groups that is not empty decides. */
std::vector<std::vector<Names>> candidates(const Names &channels, Role role) {
    const Layers layers(channels);
    std::vector<Names> named, others;
    const auto put = [](std::vector<Names> &group, const Names &names) {
        if (!names.empty() && std::find(group.begin(), group.end(), names) == group.end())
            group.push_back(names);
    };
    if (role == Role::image || role == Role::map) {
        const Names top = layers.picture("");
        std::vector<Names> lone;
        Names opaque;
        for (const std::string &layer : layers.names()) {
            for (const std::string &channel : layers.opaque(layer))
                opaque.push_back(channel);
            const Names picture = layers.picture(layer);
            put(fits(role, layer) ? named : others, picture);
        }
        if (opaque.size() == 1 && !(role == Role::image && is_named_as_another(opaque.front(), role)))
            lone.push_back(opaque);
        return {lone, top.empty() ? std::vector<Names>{} : std::vector<Names>{top}, named, others};
    }
    for (const std::string &layer : layers.names())
        if (!layer.empty() && fits(role, layer) && (role != Role::depth || keeps_depth(layer)))
            put(named, of_layer(layers, layer, role));
    if (is_vector(role)) {
        put(others, layers.triple("", "XYZ"));
        return {named, others};
    }
    for (const std::string &channel : channels) {
        const std::string layer = layer_of(channel);
        // Z beside X and Y is a vector's third axis.
        const bool axis = word_of(tail_of(channel)) == "z" && !layers.triple(layer, "XYZ").empty();
        // "Depth" says it all; a Z of a layer of another name may be mist.
        const bool other = role == Role::depth &&
                           (!may_be_metres(channel) || (word_of(tail_of(channel)) == "z" && !keeps_depth(layer)));
        if (!axis && !other && (layer.empty() || !fits(role, layer)) && fits(role, tail_of(channel)))
            put(layer.empty() || role != Role::depth ? named : others, {channel});
    }
    std::vector<Names> rest;
    Names opaque;
    for (const std::string &layer : layers.names())
        for (const std::string &channel : layers.opaque(layer))
            opaque.push_back(channel);
    if (opaque.size() == 1 &&
        (role != Role::depth || (!is_named_as_another(opaque.front(), role) && keeps_depth(layer_of(opaque.front())) &&
                                 may_be_metres(opaque.front()))))
        rest.push_back(opaque);
    else if (role != Role::depth)
        put(rest, layers.picture(""));
    return {named, others, rest};
}

[[noreturn]] void refuse(const std::string &path, const Names &channels, const std::string &what, Role role,
                         const std::string &example) {
    throw ReadError(path, fmt::format("{}; name {} behind the file's name, for example {}:{}. Its channels are: {}",
                                      what, is_vector(role) ? "a layer or three channels" : "a channel or a layer",
                                      path, example, channels.empty() ? "none" : joined(channels)));
}

/** Whether a channel is something else: no good example. */
bool is_of_another(const Layers &layers, const std::string &channel, Role role) {
    if (is_named_as_another(channel, role))
        return true;
    const Names picture = layers.picture(layer_of(channel)), vector = layers.triple(layer_of(channel), "XYZ");
    const bool colors = picture.size() == 3 || layer_of(channel).empty(); // a Y of a layer may be any number
    return (role != Role::image && colors && contains(picture, channel)) ||
           (!is_vector(role) && contains(vector, channel));
}

/** Three channels whose names differ in their last letter, in the order of meaning: a file sorts R, G, B as B, G, R. */
std::vector<Names> triples_of(const Names &channels) {
    std::vector<Names> triples;
    for (const char *axes : {"xyz", "rgb"})
        for (const std::string &first : channels) {
            const std::string stem = first.empty() ? "" : first.substr(0, first.size() - 1);
            Names found;
            for (const char *axis = axes; *axis; ++axis)
                for (const std::string &channel : channels)
                    if (channel.size() == stem.size() + 1 && channel.compare(0, stem.size(), stem) == 0 &&
                        std::tolower(static_cast<unsigned char>(channel.back())) == *axis &&
                        found.size() == static_cast<std::size_t>(axis - axes))
                        found.push_back(channel);
            if (found.size() == 3 && found.front() == first)
                triples.push_back(found);
        }
    return triples;
}

/** Three that may be a vector, rather those whose name says so. */
std::string vector_example(const Names &channels, Role role) {
    const char *const own = role == Role::normal ? "norm" : "pos";
    const std::vector<Names> triples = triples_of(channels);
    const Names *best = nullptr;
    for (const Names &triple : triples)
        if (!best || (word_of(best->front()).find(own) == std::string::npos &&
                      word_of(triple.front()).find(own) != std::string::npos))
            best = &triple;
    return best ? fmt::format("{}", fmt::join(*best, ",")) : "X,Y,Z";
}

std::string example_of(const Names &names) {
    return names.size() == 1 || layer_of(names.front()).empty() ? fmt::format("{}", fmt::join(names, ","))
                                                                : layer_of(names.front());
}

Names named(const std::string &path, const Names &channels, const ReadRequest &request) {
    const Layers layers(channels);
    Names found;
    for (std::size_t at = 0; at <= request.channel.size();) {
        const std::size_t end = std::min(request.channel.find(',', at), request.channel.size());
        const std::string one = request.channel.substr(at, end - at);
        at = end + 1;
        if (contains(channels, one)) {
            found.push_back(one);
            continue;
        }
        // The last part of a name is enough where only one channel has it.
        Names short_for;
        for (const std::string &channel : channels)
            if (channel.size() > one.size() + 1 && !one.empty() &&
                channel.compare(channel.size() - one.size() - 1, std::string::npos, "." + one) == 0)
                short_for.push_back(channel);
        if (short_for.size() == 1) {
            found.push_back(short_for.front());
            continue;
        }
        const Names layer =
            contains(layers.names(), one) && !one.empty() ? of_layer(layers, one, request.role) : Names{};
        if (layer.empty())
            throw ReadError(path, fmt::format("{} \"{}\"; its channels are: {}",
                                              short_for.empty() ? "has no channel" : "has several channels", one,
                                              joined(channels)));
        found.insert(found.end(), layer.begin(), layer.end());
    }
    if (found.size() != 3 && (is_vector(request.role) || found.size() != 1))
        throw ReadError(path, fmt::format("\"{}\" names {} channel{}; {} needed. Its channels are: {}", request.channel,
                                          found.size(), found.size() == 1 ? "" : "s",
                                          is_vector(request.role) ? "three are" : "one is, or three of a picture",
                                          joined(channels)));
    return found;
}

class SelectedReader final : public Reader {
  public:
    SelectedReader(std::unique_ptr<Reader> reader, const Names &all, const Names &selected)
        : Reader(reader->path()), reader_(std::move(reader)) {
        info_ = reader_->info();
        for (const std::string &name : selected)
            at_.push_back(static_cast<std::size_t>(std::find(all.begin(), all.end(), name) - all.begin()));
        info_.channels = static_cast<std::uint32_t>(at_.size());
        info_.alpha = false;
    }

    void read_rows(std::uint64_t frame, const RowSink &sink) override {
        std::vector<float> selected(std::size_t{info_.width} * at_.size());
        const std::size_t stride = reader_->info().channels;
        reader_->read_rows(frame, [&](const float *row) {
            float *to = selected.data();
            for (std::uint32_t x = 0; x < info_.width; ++x, row += stride)
                for (const std::size_t at : at_)
                    *to++ = row[at];
            sink(selected.data());
        });
    }

  private:
    std::unique_ptr<Reader> reader_;
    std::vector<std::size_t> at_;
};

} // namespace

std::vector<std::string> select_channels(const std::string &path, const std::vector<std::string> &channels,
                                         const ReadRequest &request) {
    if (!request.channel.empty())
        return named(path, channels, request);
    for (const std::vector<Names> &group : candidates(channels, request.role)) {
        if (group.size() == 1)
            return group.front();
        if (group.empty())
            continue;
        Names fitting;
        for (const Names &one : group)
            fitting.push_back(example_of(one));
        refuse(path, channels,
               fmt::format("several of its channels may be {}: {}", said(request.role), joined(fitting)), request.role,
               fitting.front());
    }
    std::string example = unclaimed_channel(channels, request.role);
    if (example.empty())
        example = channels.empty() ? "CHANNEL" : channels.front();
    if (is_vector(request.role))
        example = vector_example(channels, request.role);
    refuse(path, channels, fmt::format("none of its channels is named as {}", said(request.role)), request.role,
           example);
}

bool has_picture(const std::vector<std::string> &channels) {
    const Layers layers(channels);
    return std::any_of(layers.names().begin(), layers.names().end(), [&](const std::string &layer) {
        const Names picture = layers.picture(layer);
        return !picture.empty() && !is_named_as_another(picture.front(), Role::image);
    });
}

std::string unclaimed_channel(const std::vector<std::string> &channels, Role role) {
    const Layers layers(channels);
    const auto found = std::find_if(channels.begin(), channels.end(),
                                    [&](const std::string &channel) { return !is_of_another(layers, channel, role); });
    return found == channels.end() ? "" : *found;
}

std::vector<std::vector<std::string>> named_channels(const std::vector<std::string> &channels, Role role) {
    const std::vector<std::vector<Names>> groups = candidates(channels, role);
    return groups[0].empty() && role == Role::depth ? groups[1] : groups[0];
}

std::unique_ptr<Reader> select_samples(std::unique_ptr<Reader> reader, const ReadRequest &request) {
    const Info &info = reader->info();
    Names names = info.channels == 1   ? Names{"Y"}
                  : info.channels == 2 ? Names{"Y", "A"}
                  : info.channels == 3 ? Names{"R", "G", "B"}
                                       : Names{"R", "G", "B", "A"};
    const Names selected = named(reader->path(), names, request);
    return std::make_unique<SelectedReader>(std::move(reader), names, selected);
}

} // namespace image_io
