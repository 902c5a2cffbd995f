// Opaque handles: reference counted, and looked up before use, so that a NULL, released or wrong handle is an error and
// not a crash.
#pragma once

#include "clspeckle/types.h"
#include "fork.hpp"
#include "pipeline/pipeline.hpp"
#include "runtime/context.hpp"
#include "runtime/error.hpp"
#include "status.hpp"
#include "thread_rule.hpp"

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <shared_mutex>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

namespace clsp {
class Depth;
class DoePattern;
class Dots;
class Lens;
class MaterialTable;
class Motion;
} // namespace clsp

namespace clsp::capi {

// The engine's class behind each handle type, what messages call it, and which threads may use it at once.
template <typename Handle> struct HandleTraits;
#define CLSP_HANDLE(Handle, Class, name, rule)                                                                         \
    template <> struct HandleTraits<Handle> {                                                                          \
        using Object = Class;                                                                                          \
        static constexpr const char *kName = name;                                                                     \
        static constexpr ThreadRule kRule = ThreadRule::rule;                                                          \
    };
CLSP_HANDLE(ClspContext, Context, "context", kAnyThread)
CLSP_HANDLE(ClspPattern, Pattern, "pattern", kOneThread)
CLSP_HANDLE(ClspDoePattern, DoePattern, "pattern", kOneThread)
CLSP_HANDLE(ClspDots, Dots, "dots", kOneThread)
CLSP_HANDLE(ClspDepth, Depth, "depth", kOneThread)
CLSP_HANDLE(ClspMaterialTable, MaterialTable, "table", kOneThread)
CLSP_HANDLE(ClspMotion, Motion, "motion", kOneThread)
CLSP_HANDLE(ClspLens, Lens, "lens", kOneThread)
CLSP_HANDLE(ClspPhase, Phase, "phase", kOneThread)
CLSP_HANDLE(ClspAperture, Aperture, "aperture", kOneThread)
CLSP_HANDLE(ClspSensor, Sensor, "sensor", kOneThread)
CLSP_HANDLE(ClspPipeline, Pipeline, "pipeline", kOneThread)

// A number that no handle of any kind has had before, so that a released handle is never mistaken for a later one.
inline std::uintptr_t next_handle_value() {
    static std::atomic<std::uintptr_t> last{0};
    return last += 16;
}

using Parts = std::vector<std::shared_ptr<CallsInside>>;

// What a handle stands for. calls: its own, then those of the parts that it uses.
template <typename Object> struct HandleEntry {
    std::uint32_t references = 1;
    std::shared_ptr<Object> object;
    Parts calls;
};

// An object while a call uses it: it lives on, and other threads keep to the rule of its handle.
template <typename Object> class Use {
  public:
    Use(std::shared_ptr<HandleEntry<Object>> entry, bool alone) : entry_(std::move(entry)) {
        try {
            for (; entered_ < entry_->calls.size(); ++entered_)
                entry_->calls[entered_]->enter(alone);
        } catch (...) {
            leave();
            throw;
        }
    }
    Use(const Use &) = delete;
    Use &operator=(const Use &) = delete;
    ~Use() { leave(); }

    Object *operator->() const { return entry_->object.get(); }
    Object &operator*() const { return *entry_->object; }
    operator const std::shared_ptr<Object> &() const { return entry_->object; }
    const Parts &calls() const { return entry_->calls; }

  private:
    void leave() noexcept {
        while (entered_ > 0)
            entry_->calls[--entered_]->leave();
    }

    std::shared_ptr<HandleEntry<Object>> entry_;
    std::size_t entered_ = 0;
};

// All live handles of one type. One table for each type and process, never destroyed: handles may be released late at
// exit.
template <typename Handle> class HandleTable {
  public:
    using Traits = HandleTraits<Handle>;
    using Object = typename Traits::Object;
    using Entry = HandleEntry<Object>;

    static HandleTable &instance() {
        static auto *table = new HandleTable;
        return *table;
    }

    Handle add(std::shared_ptr<Object> object, const Parts &parts) {
        auto entry = std::make_shared<Entry>();
        entry->object = std::move(object);
        if constexpr (Traits::kRule != ThreadRule::kAnyThread)
            entry->calls.push_back(std::make_shared<CallsInside>(Traits::kName));
        entry->calls.insert(entry->calls.end(), parts.begin(), parts.end());
        const std::unique_lock<std::shared_mutex> lock(mutex_);
        const Handle handle = reinterpret_cast<Handle>(next_handle_value());
        entries_.emplace(handle, std::move(entry));
        return handle;
    }

    std::shared_ptr<Entry> get(Handle handle) const {
        refuse_fork();
        const std::shared_lock<std::shared_mutex> lock(mutex_);
        return find(handle);
    }

    void retain(Handle handle) {
        const std::unique_lock<std::shared_mutex> lock(mutex_);
        ++find(handle)->references;
    }

    void release(Handle handle) {
        if (!handle || was_forked())
            return;
        std::shared_ptr<Entry> last; // destroyed after the lock is given up
        const std::unique_lock<std::shared_mutex> lock(mutex_);
        if (--find(handle)->references == 0) {
            const auto found = entries_.find(handle);
            last = std::move(found->second);
            entries_.erase(found);
        }
        // `last` was declared first, so it goes after `lock`.
    }

  private:
    const std::shared_ptr<Entry> &find(Handle handle) const {
        const auto found = entries_.find(handle);
        if (found == entries_.end())
            throw Error(
                Status::kInvalidHandle,
                std::string(Traits::kName) +
                    (handle ? " is not a live handle: it was released, or is not a handle of this kind" : " is NULL"));
        return found->second;
    }

    mutable std::shared_mutex mutex_;
    std::unordered_map<Handle, std::shared_ptr<Entry>> entries_;
};

// The object for the length of a call.
template <typename Handle> Use<typename HandleTraits<Handle>::Object> object(Handle handle) {
    return {HandleTable<Handle>::instance().get(handle), HandleTraits<Handle>::kRule == ThreadRule::kOneThread};
}

// The same where the call changes what others only read.
template <typename Handle> Use<typename HandleTraits<Handle>::Object> object_to_change(Handle handle) {
    return {HandleTable<Handle>::instance().get(handle), true};
}

// A part of another object that lives longer than the call. NULL: no such part.
template <typename Handle>
std::shared_ptr<typename HandleTraits<Handle>::Object> optional_part(Handle handle, Parts &parts) {
    if (!handle)
        return nullptr;
    const auto part = object(handle);
    parts.insert(parts.end(), part.calls().begin(), part.calls().end());
    return part;
}

// Makes the handle of a new object; *handle is written only when all went well.
template <typename Handle>
void give(Handle *handle, std::shared_ptr<typename HandleTraits<Handle>::Object> object, const Parts &parts = {}) {
    *handle = HandleTable<Handle>::instance().add(std::move(object), parts);
}

} // namespace clsp::capi

// clsp<Name>Retain() and clsp<Name>Release(), within extern "C".
#define CLSP_REFERENCES(Name)                                                                                          \
    CLSP_API ClspStatus clsp##Name##Retain(Clsp##Name handle) {                                                        \
        return clsp::capi::guarded("clsp" #Name "Retain",                                                              \
                                   [&] { clsp::capi::HandleTable<Clsp##Name>::instance().retain(handle); });           \
    }                                                                                                                  \
    CLSP_API ClspStatus clsp##Name##Release(Clsp##Name handle) {                                                       \
        return clsp::capi::guarded("clsp" #Name "Release",                                                             \
                                   [&] { clsp::capi::HandleTable<Clsp##Name>::instance().release(handle); });          \
    }
