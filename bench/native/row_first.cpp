// Rows, columns, rows: the order of the engine for CPUs, in which images are read and written along their rows.
// The engine has a row in each lane; here it is one row at a time. Lane b of vector a is point a L + b of the row (L
// lanes): a transform of N / L points over vectors, whose twiddle factors are the same for all lanes; a rotation by
// w^(b c), w = exp(-2 pi i / N); and a transform of L points over lanes, behind a transposition: frequency c + d N / L,
// lane c of L neighbouring ones, for each d. Only those d are computed and stored of which the aperture lets anything
// through.
#include "native/aperture.hpp"
#include "native/orders.hpp"
#include "native/thread_pool.hpp"

#include <cmath>
#include <cstring>

namespace native {
namespace {

// Rows that a thread takes side by side, so that what it writes to each column block of kept columns lies together.
constexpr std::size_t kRows = 16;

struct RowFirstTables {
    std::vector<float> twiddles;
    std::vector<unsigned> frequencies; // c at each position
    Pages rotations;                   // of each position, the parts of w^(b c) in lane b
};

template <class P> RowFirstTables row_first_tables() {
    RowFirstTables tables{P::twiddle_table(), P::frequencies(), allocate_pages(std::size_t{2} * P::kLength * kLanes)};
    for (unsigned p = 0; p < P::kLength; ++p)
        for (unsigned b = 0; b < kLanes; ++b) {
            const unsigned n = P::kLength * kLanes;
            const double angle = -2.0 * M_PI * double(b * tables.frequencies[p] % n) / n;
            tables.rotations[std::size_t{2 * p} * kLanes + b] = float(std::cos(angle));
            tables.rotations[std::size_t{2 * p + 1} * kLanes + b] = float(std::sin(angle));
        }
    return tables;
}

// Kept columns lie as points y of column blocks of lanes. Blocks are one point further apart than they are long, or the
// vectors of a row would all lie in the same few sets of the caches.
struct KeptColumns {
    std::size_t pitch = 0; // of column blocks, in vectors
    Pages memory;
    Lanes *at(std::size_t column_block, std::size_t y) const {
        return reinterpret_cast<Lanes *>(memory.get()) + column_block * pitch + 2 * y;
    }
};

// Vectors of a row, filled up to whole column blocks.
template <class P> constexpr unsigned kRowGroups = (P::kLength + kLanes - 1) / kLanes;
template <class P> constexpr std::size_t kRowLanes = std::size_t{2} * kRowGroups<P> *kLanes;

template <class P>
void vectors_forward(const RowFirstTables &tables, const float *phase, const float *ideal, Lanes *row) {
    constexpr unsigned R = P::kFirst, M = P::kBlock, L = P::kLast;
    const float *w = tables.twiddles.data();
    for (unsigned j = 0; j < M; ++j, w += 2 * (R - 1)) {
        Complex u[R];
#pragma GCC unroll 16
        for (unsigned q = 0; q < R; ++q) {
            // The next row, while this one is computed.
            const std::size_t i = (j + q * M) * kLanes;
            __builtin_prefetch(phase + i + P::kLength * kLanes, 0, 0);
            __builtin_prefetch(ideal + i + P::kLength * kLanes, 0, 0);
            u[q] = phasor(load(phase + i), square_root(load(ideal + i)));
        }
        Butterfly<R>::forward(u);
        forward_twiddles(u, w);
        write(u, row + 2 * j, M);
    }
    const Lanes *const rotations = reinterpret_cast<const Lanes *>(tables.rotations.get());
    for (unsigned b = 0; b < R; ++b) {
        Lanes *const block = row + 2 * b * M;
        forward_middle<P>(block, tables.twiddles.data());
        for (unsigned base = 0; base < M; base += L) {
            Complex x[L];
            read(x, block + 2 * base, 1);
            Butterfly<L>::forward(x);
#pragma GCC unroll 16
            for (unsigned d = 0; d < L; ++d) {
                const Lanes *const r = rotations + 2 * (b * M + base + d);
                x[d] = {x[d].re * r[0] - x[d].im * r[1], x[d].re * r[1] + x[d].im * r[0]};
            }
            write(x, block + 2 * base, 1);
        }
    }
}

template <class P, unsigned E>
void rows_forward(const RowFirstTables &tables, const float *phase, const float *ideal, const KeptColumns &columns,
                  std::size_t y, std::size_t count, Lanes *tile) {
    for (std::size_t i = 0; i < count; ++i)
        vectors_forward<P>(tables, phase + i * P::kLength * kLanes, ideal + i * P::kLength * kLanes,
                           tile + i * kRowLanes<P>);
    for (unsigned g = 0; g < kRowGroups<P>; ++g)
        for (std::size_t i = 0; i < count; ++i) {
            const Lanes *const row = tile + i * kRowLanes<P>;
            std::size_t column_block = g * (E == kAll ? kLanes : 2 * E);
            Lanes re[kLanes], im[kLanes];
#pragma GCC unroll 16
            for (unsigned l = 0; l < kLanes; ++l) {
                re[l] = row[2 * (g * kLanes + l)];
                im[l] = row[2 * (g * kLanes + l) + 1];
            }
            transpose(re);
            transpose(im);
            Complex x[kLanes];
#pragma GCC unroll 16
            for (unsigned l = 0; l < kLanes; ++l)
                x[l] = {re[l], im[l]};
            Butterfly<kLanes>::forward(x);
#pragma GCC unroll 16
            for (unsigned d = 0; d < kLanes; ++d)
                if (at_ends<kLanes>(d, E)) {
                    Lanes *const out = columns.at(column_block++, y + i);
                    out[0] = x[d].re;
                    out[1] = x[d].im;
                }
        }
}

template <class P> void vectors_inverse(const RowFirstTables &tables, float *intensity, Lanes *row) {
    constexpr unsigned R = P::kFirst, M = P::kBlock, L = P::kLast;
    const Lanes *const rotations = reinterpret_cast<const Lanes *>(tables.rotations.get());
    for (unsigned b = 0; b < R; ++b) {
        Lanes *const block = row + 2 * b * M;
        for (unsigned base = 0; base < M; base += L) {
            Complex x[L];
            read(x, block + 2 * base, 1);
#pragma GCC unroll 16
            for (unsigned d = 0; d < L; ++d) {
                const Lanes *const r = rotations + 2 * (b * M + base + d);
                x[d] = {x[d].re * r[0] + x[d].im * r[1], x[d].im * r[0] - x[d].re * r[1]};
            }
            inverse_butterfly(x);
            write(x, block + 2 * base, 1);
        }
        inverse_middle<P>(block, tables.twiddles.data());
    }
    const float *w = tables.twiddles.data();
    for (unsigned j = 0; j < M; ++j, w += 2 * (R - 1)) {
        Complex u[R];
        read(u, row + 2 * j, M);
        inverse_twiddles(u, w);
        inverse_butterfly(u);
#pragma GCC unroll 16
        for (unsigned q = 0; q < R; ++q)
            stream(intensity + (j + q * M) * kLanes, u[q].re * u[q].re + u[q].im * u[q].im);
    }
}

template <class P, unsigned E>
void rows_inverse(const RowFirstTables &tables, const KeptColumns &columns, std::size_t y, std::size_t count,
                  float *intensity, Lanes *tile) {
    for (unsigned g = 0; g < kRowGroups<P>; ++g)
        for (std::size_t i = 0; i < count; ++i) {
            Lanes *const row = tile + i * kRowLanes<P>;
            std::size_t column_block = g * (E == kAll ? kLanes : 2 * E);
            Complex x[kLanes] = {};
#pragma GCC unroll 16
            for (unsigned d = 0; d < kLanes; ++d)
                if (at_ends<kLanes>(d, E)) {
                    const Lanes *const in = columns.at(column_block++, y + i);
                    x[d] = {in[0], in[1]};
                }
            inverse_butterfly(x);
            Lanes re[kLanes], im[kLanes];
#pragma GCC unroll 16
            for (unsigned l = 0; l < kLanes; ++l) {
                re[l] = x[l].re;
                im[l] = x[l].im;
            }
            transpose(re);
            transpose(im);
#pragma GCC unroll 16
            for (unsigned l = 0; l < kLanes; ++l) {
                row[2 * (g * kLanes + l)] = re[l];
                row[2 * (g * kLanes + l) + 1] = im[l];
            }
        }
    for (std::size_t i = 0; i < count; ++i)
        vectors_inverse<P>(tables, intensity + i * P::kLength * kLanes, tile + i * kRowLanes<P>);
}

// For each number of ends: 1, 2, 4, all.
constexpr unsigned kEnds[4] = {1, 2, 4, kAll};
struct Rows {
    RowFirstTables (*tables)();
    std::size_t row_lanes;
    void (*forward[4])(const RowFirstTables &, const float *, const float *, const KeptColumns &, std::size_t,
                       std::size_t, Lanes *);
    void (*inverse[4])(const RowFirstTables &, const KeptColumns &, std::size_t, std::size_t, float *, Lanes *);
};

template <unsigned N> constexpr Entry<Rows> rows_entry() {
    using P = typename PlanOf<N / kLanes>::type;
    return {N,
            {row_first_tables<P>,
             kRowLanes<P>,
             {rows_forward<P, 1>, rows_forward<P, 2>, rows_forward<P, 4>, rows_forward<P, kAll>},
             {rows_inverse<P, 1>, rows_inverse<P, 2>, rows_inverse<P, 4>, rows_inverse<P, kAll>}}};
}

template <unsigned... N> Rows rows_among(std::uint32_t length, std::integer_sequence<unsigned, N...>) {
    return entry_of<Rows>(length, {rows_entry<N>()...}, "rows");
}
using Widths = std::integer_sequence<unsigned, 256, 512, 1024, 1280, 1920, 2048, 4096>;

class RowFirst final : public Passes {
  public:
    RowFirst(std::uint32_t width, std::uint32_t height, double relative_diameter, unsigned threads);
    void intensity(const float *phase, const float *ideal, float *intensity) override;
    std::size_t workspace_bytes() const override { return bytes_; }

  private:
    std::uint32_t width_, height_;
    Rows rows_;
    Filter columns_;
    RowFirstTables row_tables_;
    FilterTables column_tables_;
    unsigned kind_ = 3; // of the functions for numbers of ends
    float scale_;
    KeptColumns kept_;
    std::size_t bytes_ = 0;
    std::vector<ColumnBlock> column_blocks_;
    ThreadPool pool_;
    std::vector<Pages> tiles_; // of each thread
};

RowFirst::RowFirst(std::uint32_t width, std::uint32_t height, double relative_diameter, unsigned threads)
    : width_(width), height_(height), rows_(rows_among(width, Widths{})), columns_(filter_of(height, "columns")),
      row_tables_(rows_.tables()), column_tables_(columns_.tables()), scale_(1.0f / (float(width) * float(height))),
      pool_(threads) {
    const Aperture aperture(width, height, relative_diameter);
    const std::uint32_t vectors = width / kLanes;
    const auto kx_limit = std::uint32_t(root_below(aperture.kx_square_limit(0)));
    const unsigned ends = rounded_ends<kLanes>((kx_limit + vectors - 1) / vectors);
    for (unsigned kind = 0; kind < 3; ++kind)
        if (std::max(1u, ends) == kEnds[kind])
            kind_ = kind;
    const std::size_t row_groups = rows_.row_lanes / (2 * kLanes);
    for (std::size_t g = 0; g < row_groups; ++g)
        for (unsigned d = 0; d < kLanes; ++d) {
            if (!at_ends<kLanes>(d, kEnds[kind_]))
                continue;
            ColumnBlock column_block;
            int ky_limit = -1;
            for (unsigned l = 0; l < kLanes; ++l) {
                const std::size_t p = g * kLanes + l;
                if (p >= vectors)
                    continue; // the last column block need not be full
                const std::int64_t kx = row_tables_.frequencies[p] + std::int64_t{d} * vectors;
                column_block.square_limits[l] = aperture.ky_square_limit(distance(kx, width));
                ky_limit = std::max(ky_limit, root_below(column_block.square_limits[l]));
            }
            column_block.ends = columns_.ends(column_tables_.frequencies, ky_limit);
            column_blocks_.push_back(std::move(column_block));
        }
    kept_.pitch = 2 * (std::size_t{height} + 1);
    bytes_ = column_blocks_.size() * kept_.pitch * sizeof(Lanes);
    kept_.memory = allocate_pages(bytes_ / sizeof(float));
    std::memset(kept_.memory.get(), 0, bytes_);
    for (unsigned thread = 0; thread < pool_.threads(); ++thread) {
        tiles_.push_back(allocate_pages(kRows * rows_.row_lanes * kLanes));
        std::memset(tiles_.back().get(), 0, kRows * rows_.row_lanes * sizeof(Lanes));
    }
}

void RowFirst::intensity(const float *phase, const float *ideal, float *intensity) {
    const auto items = std::uint32_t((height_ + kRows - 1) / kRows);
    std::atomic<std::uint32_t> next[3] = {};
    pool_.run([&](unsigned thread) {
        Lanes *const tile = reinterpret_cast<Lanes *>(tiles_[thread].get());
        share(next[0], items, [&](std::uint32_t i) {
            const std::size_t y = i * kRows, count = std::min(height_ - y, kRows);
            rows_.forward[kind_](row_tables_, phase + y * width_, ideal + y * width_, kept_, y, count, tile);
        });
        pool_.barrier();
        share(next[1], std::uint32_t(column_blocks_.size()), [&](std::uint32_t g) {
            columns_.run(column_tables_, column_blocks_[g].ends.data(), column_blocks_[g].square_limits, scale_,
                         kept_.at(g, 0));
        });
        pool_.barrier();
        share(next[2], items, [&](std::uint32_t i) {
            const std::size_t y = i * kRows, count = std::min(height_ - y, kRows);
            rows_.inverse[kind_](row_tables_, kept_, y, count, intensity + y * width_, tile);
        });
    });
}

} // namespace

std::unique_ptr<Passes> make_row_first(std::uint32_t width, std::uint32_t height, double relative_diameter,
                                       unsigned threads) {
    return std::make_unique<RowFirst>(width, height, relative_diameter, threads);
}

} // namespace native
