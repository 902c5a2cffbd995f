// Opaque handles: reference counted, and looked up before use, so that a NULL, released or wrong handle is an error and
// not a crash.
#pragma once

#include "clspeckle/types.h"
#include "fork.hpp"
#include "pipeline/pipeline.hpp"
#include "runtime/context.hpp"
#include "runtime/error.hpp"
#include "status.hpp"

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <shared_mutex>
#include <string>
#include <unordered_map>
#include <utility>

namespace clsp {
class Depth;
class DoePattern;
class Dots;
class Lens;
class MaterialTable;
class Motion;
} // namespace clsp

namespace clsp::capi {

// The engine's class behind each handle type, and what messages call it.
template <typename Handle> struct HandleTraits;
#define CLSP_HANDLE(Handle, Class, name)                                                                               \
    template <> struct HandleTraits<Handle> {                                                                          \
        using Object = Class;                                                                                          \
        static constexpr const char *kName = name;                                                                     \
    };
CLSP_HANDLE(ClspContext, Context, "context")
CLSP_HANDLE(ClspPattern, Pattern, "pattern")
CLSP_HANDLE(ClspDoePattern, DoePattern, "pattern")
CLSP_HANDLE(ClspDots, Dots, "dots")
CLSP_HANDLE(ClspDepth, Depth, "depth")
CLSP_HANDLE(ClspMaterialTable, MaterialTable, "table")
CLSP_HANDLE(ClspMotion, Motion, "motion")
CLSP_HANDLE(ClspLens, Lens, "lens")
CLSP_HANDLE(ClspPhase, Phase, "phase")
CLSP_HANDLE(ClspAperture, Aperture, "aperture")
CLSP_HANDLE(ClspSensor, Sensor, "sensor")
CLSP_HANDLE(ClspPipeline, Pipeline, "pipeline")

// A number that no handle of any kind has had before, so that a released handle is never mistaken for a later one.
inline std::uintptr_t next_handle_value() {
    static std::atomic<std::uintptr_t> last{0};
    return last += 16;
}

// All live handles of one type. One table for each type and process, never destroyed: handles may be released late at
// exit.
template <typename Handle> class HandleTable {
  public:
    using Object = typename HandleTraits<Handle>::Object;

    static HandleTable &instance() {
        static auto *table = new HandleTable;
        return *table;
    }

    Handle add(std::shared_ptr<Object> object) {
        auto entry = std::make_unique<Entry>();
        entry->object = std::move(object);
        const std::unique_lock<std::shared_mutex> lock(mutex_);
        const Handle handle = reinterpret_cast<Handle>(next_handle_value());
        entries_.emplace(handle, std::move(entry));
        return handle;
    }

    std::shared_ptr<Object> get(Handle handle) const {
        refuse_fork();
        const std::shared_lock<std::shared_mutex> lock(mutex_);
        return find(handle).object;
    }

    void retain(Handle handle) {
        const std::unique_lock<std::shared_mutex> lock(mutex_);
        ++find(handle).references;
    }

    void release(Handle handle) {
        if (!handle || was_forked())
            return;
        std::unique_ptr<Entry> last; // destroyed after the lock is given up
        const std::unique_lock<std::shared_mutex> lock(mutex_);
        Entry &entry = find(handle);
        if (--entry.references == 0) {
            const auto found = entries_.find(handle);
            last = std::move(found->second);
            entries_.erase(found);
        }
        // `last` was declared first, so it goes after `lock`.
    }

  private:
    struct Entry {
        std::uint32_t references = 1;
        std::shared_ptr<Object> object;
    };

    Entry &find(Handle handle) const {
        const auto found = entries_.find(handle);
        if (found == entries_.end())
            throw Error(
                Status::kInvalidHandle,
                std::string(HandleTraits<Handle>::kName) +
                    (handle ? " is not a live handle: it was released, or is not a handle of this kind" : " is NULL"));
        return *found->second;
    }

    mutable std::shared_mutex mutex_;
    std::unordered_map<Handle, std::unique_ptr<Entry>> entries_;
};

template <typename Handle> std::shared_ptr<typename HandleTraits<Handle>::Object> object(Handle handle) {
    return HandleTable<Handle>::instance().get(handle);
}

// Makes the handle of a new object; *handle is written only when all went well.
template <typename Handle> void give(Handle *handle, std::shared_ptr<typename HandleTraits<Handle>::Object> object) {
    *handle = HandleTable<Handle>::instance().add(std::move(object));
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
