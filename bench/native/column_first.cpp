// Columns, rows, columns: a vector has neighbouring columns.
#include "native/aperture.hpp"
#include "native/orders.hpp"
#include "native/thread_pool.hpp"

#include <cstring>

namespace native {
namespace {

// Strips of lanes side by side: rows are far apart in memory, and what a row brings should be used up.
constexpr unsigned kStrips = 2;
// Rows that the first pass asks for ahead in each of the parts that its first stage reads side by side. Into the
// second-level cache: rows whose distance is a power of two share few sets of the first.
constexpr unsigned kPrefetch = 8;

// The pupil columns lie in blocks of lanes: point x of block g is a pair of vectors (re, im) at 2 (g width + x), lane l
// the l-th column of the block.
struct Lines {
    std::uint32_t width = 0, column_blocks = 0;
    Pages memory;
    Lanes *column_block(std::uint32_t g) const {
        return reinterpret_cast<Lanes *>(memory.get()) + 2 * std::size_t{g} * width;
    }
};

// What a column's transform does, by its length.
struct ColumnTables {
    std::vector<float> twiddles;
    std::vector<unsigned> frequencies;
    std::vector<std::uint8_t> ends;
    // Positions of the pupil columns, in blocks of lanes; the last one is filled up with the length.
    std::vector<std::uint32_t> kept;
    // Positions that the inverse reads although no line stands there.
    std::vector<std::uint32_t> empty;
    // For each block of the first stage: column blocks that are complete behind it, and those that reach into it or lie
    // before it, and empty positions up to its end.
    struct Block {
        std::uint32_t complete, begun, empty;
    };
    std::vector<Block> blocks;
};

template <class P> ColumnTables column_tables(int limit) {
    constexpr unsigned N = P::kLength;
    ColumnTables tables;
    tables.twiddles = P::twiddle_table();
    tables.frequencies = P::frequencies();
    tables.ends = ends_of<P>(tables.frequencies, limit);
    for (unsigned p = 0; p < N; ++p) {
        const unsigned frequency = tables.frequencies[p];
        const unsigned ends = tables.ends[p / P::kLast];
        if (int(std::min(frequency, N - frequency)) <= limit)
            tables.kept.push_back(p);
        else if (at_ends<P::kLast>(p % P::kLast, ends))
            tables.empty.push_back(p);
        if ((p + 1) % P::kBlock == 0) {
            const auto kept = std::uint32_t(tables.kept.size());
            tables.blocks.push_back({kept / kLanes, (kept + kLanes - 1) / kLanes, std::uint32_t(tables.empty.size())});
        }
    }
    tables.blocks.back().complete = tables.blocks.back().begun;
    tables.kept.resize(std::size_t{tables.blocks.back().begun} * kLanes, N);
    return tables;
}

// A tile of one strip: the points, and one more that stands for lines that are not there.
template <class P> constexpr std::size_t kTileLanes = 2 * (P::kLength + 1);

// The first pass for STRIPS strips from column x on.
template <class P, unsigned STRIPS>
void columns_forward(const ColumnTables &tables, const float *phase, const float *ideal, const Lines &lines,
                     std::uint32_t x, Lanes *tiles) {
    constexpr unsigned R = P::kFirst, M = P::kBlock;
    const std::size_t width = lines.width;
    const float *w = tables.twiddles.data();
    for (unsigned j = 0; j < M; ++j, w += 2 * (R - 1)) {
#pragma GCC unroll 4
        for (unsigned strip = 0; strip < STRIPS; ++strip) {
            Complex u[R];
#pragma GCC unroll 16
            for (unsigned q = 0; q < R; ++q) {
                const std::size_t i = (j + q * M) * width + x + strip * kLanes;
                __builtin_prefetch(phase + i + kPrefetch * width, 0, 2);
                __builtin_prefetch(ideal + i + kPrefetch * width, 0, 2);
                u[q] = phasor(load(phase + i), square_root(load(ideal + i)));
            }
            Butterfly<R>::forward(u);
            forward_twiddles(u, w);
            write(u, tiles + strip * kTileLanes<P> + 2 * j, M);
        }
    }
    for (unsigned strip = 0; strip < STRIPS; ++strip) {
        Lanes *const tile = tiles + strip * kTileLanes<P>;
        std::uint32_t column_block = 0;
        for (unsigned b = 0; b < R; ++b) {
            Lanes *const block = tile + 2 * b * M;
            forward_middle<P>(block, tables.twiddles.data());
            forward_last<P>(block, tables.ends.data() + b * M / P::kLast);
            for (; column_block < tables.blocks[b].complete; ++column_block) {
                const std::uint32_t *const positions = tables.kept.data() + std::size_t{column_block} * kLanes;
                Lanes re[kLanes], im[kLanes];
                Lanes *const out = lines.column_block(column_block) + 2 * (std::size_t{x} + strip * kLanes);
#pragma GCC unroll 16
                for (unsigned l = 0; l < kLanes; ++l)
                    re[l] = tile[2 * positions[l]];
                transpose(re);
#pragma GCC unroll 16
                for (unsigned l = 0; l < kLanes; ++l)
                    out[2 * l] = re[l];
#pragma GCC unroll 16
                for (unsigned l = 0; l < kLanes; ++l)
                    im[l] = tile[2 * positions[l] + 1];
                transpose(im);
#pragma GCC unroll 16
                for (unsigned l = 0; l < kLanes; ++l)
                    out[2 * l + 1] = im[l];
            }
        }
    }
}

// The last pass likewise.
template <class P, unsigned STRIPS>
void columns_inverse(const ColumnTables &tables, const Lines &lines, std::uint32_t x, float *intensity, Lanes *tiles) {
    constexpr unsigned R = P::kFirst, M = P::kBlock;
    const std::size_t width = lines.width;
    for (unsigned strip = 0; strip < STRIPS; ++strip) {
        Lanes *const tile = tiles + strip * kTileLanes<P>;
        std::uint32_t column_block = 0, empty = 0;
        for (unsigned b = 0; b < R; ++b) {
            for (; empty < tables.blocks[b].empty; ++empty)
                tile[2 * tables.empty[empty]] = tile[2 * tables.empty[empty] + 1] = Lanes{};
            for (; column_block < tables.blocks[b].begun; ++column_block) {
                const std::uint32_t *const positions = tables.kept.data() + std::size_t{column_block} * kLanes;
                const Lanes *const in = lines.column_block(column_block) + 2 * (std::size_t{x} + strip * kLanes);
                Lanes re[kLanes], im[kLanes];
#pragma GCC unroll 16
                for (unsigned l = 0; l < kLanes; ++l)
                    re[l] = in[2 * l];
                transpose(re);
#pragma GCC unroll 16
                for (unsigned l = 0; l < kLanes; ++l)
                    tile[2 * positions[l]] = re[l];
#pragma GCC unroll 16
                for (unsigned l = 0; l < kLanes; ++l)
                    im[l] = in[2 * l + 1];
                transpose(im);
#pragma GCC unroll 16
                for (unsigned l = 0; l < kLanes; ++l)
                    tile[2 * positions[l] + 1] = im[l];
            }
            Lanes *const block = tile + 2 * b * M;
            inverse_last<P>(block, tables.ends.data() + b * M / P::kLast);
            inverse_middle<P>(block, tables.twiddles.data());
        }
    }
    const float *w = tables.twiddles.data();
    for (unsigned j = 0; j < M; ++j, w += 2 * (R - 1)) {
#pragma GCC unroll 4
        for (unsigned strip = 0; strip < STRIPS; ++strip) {
            Complex u[R];
            read(u, tiles + strip * kTileLanes<P> + 2 * j, M);
            inverse_twiddles(u, w);
            inverse_butterfly(u);
#pragma GCC unroll 16
            for (unsigned q = 0; q < R; ++q)
                stream(intensity + (j + q * M) * width + x + strip * kLanes, u[q].re * u[q].re + u[q].im * u[q].im);
        }
    }
}

struct Columns {
    ColumnTables (*tables)(int limit);
    std::size_t tile_lanes;
    void (*forward)(const ColumnTables &, const float *, const float *, const Lines &, std::uint32_t, Lanes *);
    void (*forward_one)(const ColumnTables &, const float *, const float *, const Lines &, std::uint32_t, Lanes *);
    void (*inverse)(const ColumnTables &, const Lines &, std::uint32_t, float *, Lanes *);
    void (*inverse_one)(const ColumnTables &, const Lines &, std::uint32_t, float *, Lanes *);
};

template <unsigned N> constexpr Entry<Columns> columns_entry() {
    using P = typename PlanOf<N>::type;
    return {N,
            {column_tables<P>, kTileLanes<P>, columns_forward<P, kStrips>, columns_forward<P, 1>,
             columns_inverse<P, kStrips>, columns_inverse<P, 1>}};
}

template <unsigned... N> Columns columns_among(std::uint32_t length, std::integer_sequence<unsigned, N...>) {
    return entry_of<Columns>(length, {columns_entry<N>()...}, "columns");
}
using Heights = std::integer_sequence<unsigned, 64, 96, 128, 256, 512, 720, 1024, 1080, 2048, 4096>;

class ColumnFirst final : public Passes {
  public:
    ColumnFirst(std::uint32_t width, std::uint32_t height, double relative_diameter, unsigned threads);
    void intensity(const float *phase, const float *ideal, float *intensity) override;
    std::size_t workspace_bytes() const override { return bytes_; }

  private:
    std::uint32_t width_;
    Columns columns_;
    Filter rows_;
    ColumnTables column_tables_;
    FilterTables row_tables_;
    unsigned strips_;
    float scale_;
    Lines lines_;
    std::size_t bytes_;
    std::vector<ColumnBlock> column_blocks_;
    ThreadPool pool_;
    std::vector<Pages> tiles_; // of each thread
};

ColumnFirst::ColumnFirst(std::uint32_t width, std::uint32_t height, double relative_diameter, unsigned threads)
    : width_(width), columns_(columns_among(height, Heights{})), rows_(filter_of(width, "rows")),
      row_tables_(rows_.tables()), strips_(width % (kStrips * kLanes) == 0 ? kStrips : 1),
      scale_(1.0f / (float(width) * float(height))), pool_(threads) {
    if (width % kLanes != 0)
        throw std::invalid_argument("widths are multiples of " + std::to_string(kLanes));
    const Aperture aperture(width, height, relative_diameter);
    column_tables_ = columns_.tables(root_below(aperture.ky_square_limit(0)));
    lines_.width = width;
    lines_.column_blocks = column_tables_.blocks.back().begun;
    bytes_ = std::size_t{lines_.column_blocks} * width * 2 * sizeof(Lanes);
    lines_.memory = allocate_pages(bytes_ / sizeof(float));
    std::memset(lines_.memory.get(), 0, bytes_);
    for (std::uint32_t g = 0; g < lines_.column_blocks; ++g) {
        ColumnBlock column_block;
        int kx_limit = -1;
        for (unsigned l = 0; l < kLanes; ++l) {
            const std::uint32_t p = column_tables_.kept[std::size_t{g} * kLanes + l];
            if (p == height)
                continue;
            column_block.square_limits[l] = aperture.kx_square_limit(distance(column_tables_.frequencies[p], height));
            kx_limit = std::max(kx_limit, root_below(column_block.square_limits[l]));
        }
        column_block.ends = rows_.ends(row_tables_.frequencies, kx_limit);
        column_blocks_.push_back(std::move(column_block));
    }
    for (unsigned thread = 0; thread < pool_.threads(); ++thread) {
        const std::size_t lanes_of_tiles = strips_ * columns_.tile_lanes;
        tiles_.push_back(allocate_pages(lanes_of_tiles * kLanes));
        std::memset(tiles_.back().get(), 0, lanes_of_tiles * sizeof(Lanes));
    }
}

void ColumnFirst::intensity(const float *phase, const float *ideal, float *intensity) {
    const std::uint32_t step = strips_ * kLanes, items = width_ / step;
    const auto forward = strips_ == 1 ? columns_.forward_one : columns_.forward;
    const auto inverse = strips_ == 1 ? columns_.inverse_one : columns_.inverse;
    std::atomic<std::uint32_t> next[3] = {};
    pool_.run([&](unsigned thread) {
        Lanes *const tiles = reinterpret_cast<Lanes *>(tiles_[thread].get());
        share(next[0], items, [&](std::uint32_t i) { forward(column_tables_, phase, ideal, lines_, i * step, tiles); });
        pool_.barrier();
        share(next[1], lines_.column_blocks, [&](std::uint32_t g) {
            rows_.run(row_tables_, column_blocks_[g].ends.data(), column_blocks_[g].square_limits, scale_,
                      lines_.column_block(g));
        });
        pool_.barrier();
        share(next[2], items, [&](std::uint32_t i) { inverse(column_tables_, lines_, i * step, intensity, tiles); });
    });
}

} // namespace

std::unique_ptr<Passes> make_column_first(std::uint32_t width, std::uint32_t height, double relative_diameter,
                                          unsigned threads) {
    return std::make_unique<ColumnFirst>(width, height, relative_diameter, threads);
}

} // namespace native
