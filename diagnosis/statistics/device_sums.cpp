#include "statistics/device_sums.hpp"

#include "runtime/command_chain.hpp"
#include "runtime/error.hpp"
#include "runtime/kernel_arguments.hpp"
#include "statistics/sums.hpp"

#include <algorithm>
#include <cstdlib>
#include <fmt/core.h>
#include <string>

namespace clsp::statistics {

// In frame t < frames, row by row: the sum over x of image a + t a_step at (ax + x, ay + y row_step) times image b + t
// b_step at (bx + x, by + y row_step).
struct RowProduct {
    cl_uint a, a_step, b, b_step;
    cl_uint weight; // image that a is multiplied with first, plus 1; 0: none
    cl_uint ax, ay, bx, by, width, rows, row_step, frames;
    cl_uint lopsided; // a b (a - b) instead of a b
};
static_assert(sizeof(RowProduct) == 14 * sizeof(cl_uint),
              "row_product of diagnosis/frame_sums.cl has these members alone");

namespace {

constexpr std::size_t kGroup = 64; // of diagnosis/frame_sums.cl
constexpr const char *kStage = "frame sums";
// Images that come behind the residuals, which are multiplied with them: the brightness, four derivatives.
constexpr std::size_t kFactors = 5;
// Of smaller images, whose thirds and bins are next to nothing.
constexpr std::size_t kSmallestSide = 12;

cl_uint as_uint(std::size_t value) {
    return static_cast<cl_uint>(value);
}

bool has_double_precision(const Context &context) {
    return context.device().getInfo<CL_DEVICE_DOUBLE_FP_CONFIG>() != 0;
}

// Image `a` with itself in frame t + later, all of it.
RowProduct whole(const Geometry &geometry, std::size_t later) {
    RowProduct product{};
    product.a_step = product.b_step = 1;
    product.b = as_uint(later);
    product.width = as_uint(geometry.width);
    product.rows = as_uint(geometry.height);
    product.row_step = 1;
    product.frames = as_uint(geometry.frames - later);
    return product;
}

// Pixels at a lag, as lag_sum() takes them; no rows if none are that far apart.
RowProduct lagged(std::size_t width, std::size_t height, std::size_t frames, Lag lag) {
    const auto shift_x = std::size_t(std::abs(lag.dx)), shift_y = std::size_t(std::abs(lag.dy));
    RowProduct product{};
    product.a_step = product.b_step = product.row_step = 1;
    product.frames = as_uint(frames);
    if (shift_x >= width || shift_y >= height)
        return product;
    (lag.dx < 0 ? product.ax : product.bx) = as_uint(shift_x);
    (lag.dy < 0 ? product.ay : product.by) = as_uint(shift_y);
    product.width = as_uint(width - shift_x);
    product.rows = as_uint(height - shift_y);
    return product;
}

} // namespace

DeviceSums::DeviceSums(std::shared_ptr<Context> context, bool may_give_up)
    : context_(std::move(context)), may_give_up_(may_give_up), queue_(context_->cl_context(), context_->device()),
      guard_(*context_, queue_) {
    const std::string defines = fmt::format("-DBIN={}", kBin);
    const auto kernel = [&](const char *name) { return context_->kernel("diagnosis/frame_sums.cl", name, defines); };
    count_ = kernel("frame_sums_count");
    residuals_ = kernel("frame_sums_residuals");
    row_powers_ = kernel("frame_sums_powers");
    products_ = kernel("frame_sums_products");
    columns_ = kernel("frame_sums_columns");
    bins_of_ = kernel("frame_sums_bins");
    edge_columns_ = kernel("frame_sums_edge_columns");
    edge_rows_ = kernel("frame_sums_edge_rows");
    const float unmasked = 1.0f;
    upload(weight_, &unmasked, sizeof unmasked);
}

DeviceSums::~DeviceSums() = default;

StatisticsChoice environment_statistics_choice() {
    const char *set = ::secure_getenv("CLSPECKLE_STATISTICS");
    const std::string choice = set ? set : "";
    if (choice.empty() || choice == "auto")
        return StatisticsChoice::kAuto;
    if (choice == "host")
        return StatisticsChoice::kHost;
    if (choice == "device")
        return StatisticsChoice::kDevice;
    throw Error(
        Status::kInvalidArgument,
        fmt::format("the environment variable CLSPECKLE_STATISTICS is \"{}\"; set it to auto, host or device, or "
                    "unset it",
                    choice));
}

std::unique_ptr<DeviceSums> make_device_sums(const std::shared_ptr<Context> &context, StatisticsChoice choice) {
    const bool is_gpu = (context->device().getInfo<CL_DEVICE_TYPE>() & CL_DEVICE_TYPE_GPU) != 0;
    if (choice == StatisticsChoice::kHost || (choice == StatisticsChoice::kAuto && !is_gpu))
        return nullptr;
    const bool is_forced = choice == StatisticsChoice::kDevice;
    if (!has_double_precision(*context)) {
        const std::string why = fmt::format("the device {} has no double precision, which the sums over pixels take",
                                            context->device_name());
        if (is_forced)
            throw Error(Status::kUnsupported, why + "; set CLSPECKLE_STATISTICS to auto or host, or unset it");
        context->log(LogLevel::kInfo, "the host takes the statistics' sums: " + why);
        return nullptr;
    }
    if (is_forced)
        return std::make_unique<DeviceSums>(context, false);
    try {
        return std::make_unique<DeviceSums>(context, true);
    } catch (const Error &error) {
        context->log(LogLevel::kWarning, fmt::format("the host takes the statistics' sums: {}", error.what()));
    } catch (const cl::Error &error) {
        context->log(LogLevel::kWarning,
                     fmt::format("the host takes the statistics' sums: {} failed with {}", error.what(), error.err()));
    }
    return nullptr;
}

bool DeviceSums::gives_up(const std::string &why) {
    if (!may_give_up_)
        return false;
    gave_up_ = true;
    context_->log(LogLevel::kWarning, fmt::format("the host takes the statistics' sums from here on: {}", why));
    return true;
}

bool DeviceSums::takes(const Geometry &geometry) const {
    constexpr std::size_t kMostCodes = std::size_t{1} << 31; // which are counted in 32 bits
    // At most so many sums are taken of a row at once, by sum_speckle() of its rows or of those of its bins.
    constexpr std::size_t kMostSums = 32;
    const std::uint64_t most = context_->device().getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>();
    return !gave_up_ && std::min(geometry.width, geometry.height) >= kSmallestSide &&
           geometry.frames * geometry.pixels < kMostCodes &&
           (geometry.frames + kFactors) * geometry.pixels * sizeof(float) <= most &&
           geometry.frames * geometry.height * kMostSums * sizeof(double) <= most;
}

const cl::Buffer &DeviceSums::reserve(DeviceBuffer &buffer, std::size_t bytes) {
    if (!buffer || buffer.bytes() < bytes)
        buffer = DeviceBuffer(context_, bytes);
    return buffer.get();
}

void DeviceSums::upload(DeviceBuffer &buffer, const void *values, std::size_t bytes, std::size_t offset) {
    reserve(buffer, offset + bytes);
    check_opencl(clEnqueueWriteBuffer(queue_(), buffer.get()(), CL_TRUE, offset, bytes, values, 0, nullptr, nullptr),
                 "clEnqueueWriteBuffer");
}

void DeviceSums::download(const DeviceBuffer &buffer, void *values, std::size_t bytes, std::size_t offset) const {
    check_opencl(clEnqueueReadBuffer(queue_(), buffer.get()(), CL_TRUE, offset, bytes, values, 0, nullptr, nullptr),
                 "clEnqueueReadBuffer");
}

void DeviceSums::run_rows(const cl::Kernel &kernel, std::size_t rows, std::size_t images, std::size_t products) {
    CommandChain(queue_(), 0, nullptr).run(kStage, kernel, kLanes * rows, images, products, kGroup);
}

std::vector<double> DeviceSums::count_codes(const Geometry &geometry, const std::uint16_t *codes,
                                            std::vector<std::uint64_t> &histogram) {
    const std::size_t height = geometry.height, rows = geometry.frames * height;
    upload(codes_, codes, geometry.frames * geometry.pixels * sizeof *codes);
    if (geometry.is_masked())
        upload(weight_, geometry.weight.data(), geometry.pixels * sizeof(float));
    std::vector<cl_uint> counts(histogram.size());
    upload(small_, counts.data(), counts.size() * sizeof(cl_uint));
    KernelArguments(count_)
        .add(codes_.get())
        .add(weight_.get())
        .add(cl_uint{geometry.is_masked()})
        .add(as_uint(geometry.width))
        .add(as_uint(height))
        .add(as_uint(histogram.size() - 1))
        .add(small_.get())
        .add(reserve(sums_, rows * sizeof(cl_uint)));
    run_rows(count_, height, geometry.frames);
    download(small_, counts.data(), counts.size() * sizeof(cl_uint));
    std::copy(counts.begin(), counts.end(), histogram.begin());
    std::vector<cl_uint> row_sums(rows);
    download(sums_, row_sums.data(), rows * sizeof(cl_uint));
    std::vector<double> sums;
    for (std::size_t t = 0; t < geometry.frames; ++t) {
        std::uint64_t total = 0;
        for (std::size_t y = 0; y < height; ++y)
            total += row_sums[t * height + y];
        sums.push_back(double(total));
    }
    return sums;
}

void DeviceSums::make_residuals(const Geometry &geometry, const ResidualScale &scale, Frames &frames) {
    const std::size_t count = geometry.frames, pixels = geometry.pixels, height = geometry.height;
    // Scales, offsets and shifts, each in a buffer of its own.
    std::vector<float> shifts(count);
    for (std::size_t t = 0; t < count; ++t)
        shifts[t] = scale.offset[t] + scale.pivot;
    const std::size_t bytes = count * sizeof(float);
    upload(by_frame_, scale.scale.data(), bytes);
    upload(small_, scale.offset.data(), bytes);
    upload(sums_, shifts.data(), bytes);
    KernelArguments(residuals_)
        .add(codes_.get())
        .add(weight_.get())
        .add(cl_uint{geometry.is_masked()})
        .add(as_uint(pixels))
        .add(as_uint(count))
        .add(cl_float{scale.black})
        .add(cl_float{scale.pivot})
        .add(by_frame_.get())
        .add(small_.get())
        .add(sums_.get())
        .add(cl_uint{scale.clipping})
        .add(cl_uint{scale.any_clip})
        .add(cl_float{1.0f / float(count)})
        .add(cl_float{count > 1 ? 1.0f / float(count - 1) : 0.0f})
        .add(reserve(images_, (count + kFactors) * pixels * sizeof(float)))
        .add(reserve(mean_, pixels * sizeof(float)))
        .add(reserve(variance_, pixels * sizeof(float)));
    CommandChain(queue_(), 0, nullptr).run(kStage, residuals_, pixels);
    frames.mean.resize(pixels);
    download(mean_, frames.mean.data(), pixels * sizeof(float));
    if (count < 2)
        return;
    frames.variance.resize(pixels);
    download(variance_, frames.variance.data(), pixels * sizeof(float));
    powers_ = row_powers(images_.get(), count, pixels, geometry.width, height);
    frames.row_mean.resize(count * height);
    for (std::size_t i = 0; i < frames.row_mean.size(); ++i)
        frames.row_mean[i] = ratio(powers_[i].sum, geometry.row_used[i % height]);
}

std::vector<Powers> DeviceSums::row_powers(const cl::Buffer &images, std::size_t count, std::size_t pixels,
                                           std::size_t width, std::size_t rows) {
    std::vector<cl_double4> sums(count * rows);
    KernelArguments(row_powers_)
        .add(images)
        .add(as_uint(pixels))
        .add(as_uint(width))
        .add(as_uint(rows))
        .add(reserve(sums_, sums.size() * sizeof(cl_double4)));
    run_rows(row_powers_, rows, count);
    download(sums_, sums.data(), sums.size() * sizeof(cl_double4));
    std::vector<Powers> powers(sums.size());
    for (std::size_t i = 0; i < sums.size(); ++i)
        powers[i] = {sums[i].s[0], sums[i].s[1], sums[i].s[2], sums[i].s[3]};
    return powers;
}

void DeviceSums::sum_products(const cl::Buffer &images, std::size_t pixels, std::size_t pitch,
                              const std::vector<RowProduct> &products) {
    most_frames_ = most_rows_ = 1;
    for (const RowProduct &product : products) {
        most_frames_ = std::max<std::size_t>(most_frames_, product.frames);
        most_rows_ = std::max<std::size_t>(most_rows_, product.rows);
    }
    values_.resize(products.size() * most_frames_ * most_rows_);
    upload(row_products_, products.data(), products.size() * sizeof(RowProduct));
    KernelArguments(products_)
        .add(images)
        .add(as_uint(pixels))
        .add(as_uint(pitch))
        .add(row_products_.get())
        .add(as_uint(most_rows_))
        .add(reserve(sums_, values_.size() * sizeof(double)));
    run_rows(products_, most_rows_, most_frames_, products.size());
    download(sums_, values_.data(), values_.size() * sizeof(double));
}

double DeviceSums::sum_of(std::size_t product, std::size_t frame, std::size_t rows) const {
    double total = 0.0;
    for (std::size_t y = 0; y < rows; ++y)
        total += row_sum(product, frame, y);
    return total;
}

std::vector<ResidualFrameSums> DeviceSums::sum_residuals(const Geometry &geometry, const Frames &,
                                                         const ResidualWeights &weights,
                                                         const std::vector<std::size_t> &lags) {
    const std::size_t count = geometry.frames, pixels = geometry.pixels, width = geometry.width,
                      height = geometry.height;
    const bool is_weighted = !weights.brightness.empty();
    std::vector<RowProduct> products{whole(geometry, 0)};
    for (const std::size_t lag : lags)
        products.push_back(whole(geometry, lag));
    if (is_weighted) {
        for (RowProduct &product : products)
            product.weight = as_uint(count + 1);
        const std::size_t bytes = pixels * sizeof(float);
        upload(images_, weights.brightness.data(), bytes, count * bytes);
        for (std::size_t k = 0; k < weights.derivatives.size(); ++k) {
            upload(images_, weights.derivatives[k].data(), bytes, (count + 1 + k) * bytes);
            RowProduct product = whole(geometry, 0);
            product.b = as_uint(count + 1 + k);
            product.b_step = 0;
            products.push_back(product);
        }
    }
    const std::size_t first_noise = products.size();
    if (!geometry.moving)
        for (const Lag &lag : kNoiseLags)
            products.push_back(lagged(width, height, count, lag));
    sum_products(images_.get(), pixels, width, products);

    std::vector<float> columns(count * width);
    KernelArguments(columns_)
        .add(images_.get())
        .add(as_uint(width))
        .add(as_uint(height))
        .add(reserve(small_, columns.size() * sizeof(float)));
    CommandChain(queue_(), 0, nullptr).run(kStage, columns_, width, count);
    download(small_, columns.data(), columns.size() * sizeof(float));

    std::vector<ResidualFrameSums> parts(count);
    for (std::size_t t = 0; t < count; ++t) {
        ResidualFrameSums &part = parts[t];
        for (std::size_t y = 0; y < height; ++y)
            part.powers.add(powers_[t * height + y]);
        for (std::size_t x = 0; x < width; ++x) {
            const float column = columns[t * width + x];
            part.column_variance += ratio(double(column) * column, geometry.column_used[x]) / double(width);
        }
        part.square = sum_of(0, t, height);
        part.temporal.assign(lags.size(), 0.0);
        for (std::size_t k = 0; k < lags.size(); ++k)
            if (t + lags[k] < count)
                part.temporal[k] = sum_of(1 + k, t, height);
        if (is_weighted)
            for (std::size_t k = 0; k < part.motion.size(); ++k)
                part.motion[k] = sum_of(1 + lags.size() + k, t, height);
        if (!geometry.moving)
            for (std::size_t k = 0; k < kNoiseLags.size(); ++k)
                part.noise[k] = sum_of(first_noise + k, t, products[first_noise + k].rows);
    }
    return parts;
}

std::vector<SpeckleFrameSums> DeviceSums::sum_speckle(const Geometry &geometry, const Frames &) {
    const std::size_t count = geometry.frames, width = geometry.width, height = geometry.height;
    std::vector<RowProduct> products{whole(geometry, 0), lagged(width, height, count, {1, 0}),
                                     lagged(width, height, count, {0, 1})};
    products[1].lopsided = products[2].lopsided = 1;
    constexpr std::size_t kFirstLag = 3, kFirstRegion = kFirstLag + kSpeckleLags.size();
    for (const Lag &lag : kSpeckleLags)
        products.push_back(lagged(width, height, count, lag));
    // Of the three columns of regions: themselves, with the next pixel, with the next row.
    for (std::size_t c = 0; c < 3; ++c) {
        const std::size_t left = (c * width + 2) / 3, right = ((c + 1) * width + 2) / 3;
        for (const Lag &lag : {Lag{0, 0}, Lag{1, 0}, Lag{0, 1}}) {
            RowProduct product = lagged(right - left, height, count, lag);
            product.ax += as_uint(left);
            product.bx += as_uint(left);
            products.push_back(product);
        }
    }
    sum_products(images_.get(), geometry.pixels, width, products);
    std::vector<SpeckleFrameSums> parts(count);
    for (std::size_t t = 0; t < count; ++t) {
        SpeckleFrameSums &part = parts[t];
        part.square = sum_of(0, t, height);
        part.lopsided_x = sum_of(1, t, height);
        part.lopsided_y = sum_of(2, t, height - 1);
        for (std::size_t k = 0; k < kSpeckleLags.size(); ++k)
            part.lag[k] = sum_of(kFirstLag + k, t, products[kFirstLag + k].rows);
        for (std::size_t y = 0; y < height; ++y)
            for (std::size_t c = 0; c < 3; ++c) {
                const std::size_t region = 3 * (3 * y / height) + c, first = kFirstRegion + 3 * c;
                part.region_square[region] += row_sum(first, t, y);
                part.region_neighbour[region] += row_sum(first + 1, t, y);
                if (y + 1 < height)
                    part.region_neighbour[region] += row_sum(first + 2, t, y);
            }
    }

    const std::size_t bins_x = width / kBin, bins_y = height / kBin;
    KernelArguments(bins_of_)
        .add(images_.get())
        .add(as_uint(geometry.pixels))
        .add(as_uint(width))
        .add(as_uint(bins_x))
        .add(as_uint(bins_y))
        .add(reserve(bins_, count * bins_x * bins_y * sizeof(float)));
    CommandChain(queue_(), 0, nullptr).run(kStage, bins_of_, bins_x, bins_y, count);
    const std::vector<Powers> powers = row_powers(bins_.get(), count, bins_x * bins_y, bins_x * bins_y, 1);
    std::vector<RowProduct> of_rings;
    for (const std::vector<Lag> &ring : ring_lags())
        for (const Lag &lag : ring)
            of_rings.push_back(lagged(bins_x, bins_y, count, lag));
    sum_products(bins_.get(), bins_x * bins_y, bins_x, of_rings);
    for (std::size_t t = 0; t < count; ++t) {
        parts[t].bins.add(powers[t]);
        std::size_t product = 0;
        for (std::size_t k = 0; k < kRings.size(); ++k)
            for (std::size_t i = 0; i < ring_lags()[k].size(); ++i, ++product)
                parts[t].ring[k] += sum_of(product, t, of_rings[product].rows);
    }
    return parts;
}

std::vector<DotLagFrameSums> DeviceSums::sum_dot_lags(const Geometry &geometry, const Frames &) {
    std::vector<RowProduct> products;
    for (const Lag &lag : kDotLags)
        products.push_back(lagged(geometry.width, geometry.height, geometry.frames, lag));
    sum_products(images_.get(), geometry.pixels, geometry.width, products);
    std::vector<DotLagFrameSums> parts(geometry.frames);
    for (std::size_t t = 0; t < geometry.frames; ++t)
        for (std::size_t k = 0; k < kDotLags.size(); ++k)
            parts[t][k] = sum_of(k, t, products[k].rows);
    return parts;
}

std::vector<EdgeFrameSums> DeviceSums::sum_edges(const Geometry &geometry) {
    const std::size_t count = geometry.frames, width = geometry.width, height = geometry.height;
    std::vector<cl_uint> columns(count * (width - 1)), rows(count * (height - 1));
    const auto set = [&](cl::Kernel &kernel, DeviceBuffer &buffer, std::size_t values) {
        KernelArguments(kernel)
            .add(codes_.get())
            .add(weight_.get())
            .add(cl_uint{geometry.is_masked()})
            .add(as_uint(width))
            .add(as_uint(height))
            .add(reserve(buffer, values * sizeof(cl_uint)));
    };
    set(edge_columns_, small_, columns.size());
    set(edge_rows_, sums_, rows.size());
    CommandChain(queue_(), 0, nullptr).run(kStage, edge_columns_, width - 1, count);
    run_rows(edge_rows_, height - 1, count);
    download(small_, columns.data(), columns.size() * sizeof(cl_uint));
    download(sums_, rows.data(), rows.size() * sizeof(cl_uint));
    std::vector<EdgeFrameSums> parts(count);
    const auto part_of = [](const std::vector<cl_uint> &all, std::size_t t, std::size_t size) {
        const auto first = all.begin() + std::ptrdiff_t(t * size);
        return std::vector<std::uint64_t>(first, first + std::ptrdiff_t(size));
    };
    for (std::size_t t = 0; t < count; ++t) {
        parts[t].columns = part_of(columns, t, width - 1);
        parts[t].rows = part_of(rows, t, height - 1);
    }
    return parts;
}

std::vector<std::vector<double>> DeviceSums::frame_differences(const Geometry &geometry, const Frames &) {
    const std::size_t count = geometry.frames, farthest = std::min(kFarthestRepeat, count - 1);
    std::vector<RowProduct> products;
    for (std::size_t later = 0; later <= farthest; ++later) {
        products.push_back(whole(geometry, later));
        products.back().rows = as_uint((geometry.height + kRepeatRows - 1) / kRepeatRows);
        products.back().row_step = as_uint(kRepeatRows);
    }
    sum_products(images_.get(), geometry.pixels, geometry.width, products);
    const std::size_t rows = products.front().rows;
    std::vector<std::vector<double>> parts(count);
    for (std::size_t t = 0; t < count; ++t)
        for (std::size_t later = 1; later <= farthest && t + later < count; ++later)
            parts[t].push_back(
                std::max(sum_of(0, t, rows) - 2.0 * sum_of(later, t, rows) + sum_of(0, t + later, rows), 0.0));
    return parts;
}

std::vector<const float *> DeviceSums::residual_images(const Geometry &geometry, const Frames &,
                                                       const std::vector<std::size_t> &which) {
    host_images_.resize(which.size());
    std::vector<const float *> images;
    for (std::size_t k = 0; k < which.size(); ++k) {
        host_images_[k].resize(geometry.pixels);
        const std::size_t bytes = geometry.pixels * sizeof(float);
        download(images_, host_images_[k].data(), bytes, which[k] * bytes);
        images.push_back(host_images_[k].data());
    }
    return images;
}

} // namespace clsp::statistics
