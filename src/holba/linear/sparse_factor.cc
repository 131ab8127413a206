// SPDX-License-Identifier: BSD-3-Clause
// Multifrontal sparse Cholesky factor of a block matrix (Duff and Reid 1983): a tree of fronts
// (panel_front.h). A front adds up its blocks of S and the updates of its children, eliminates its
// nodes, and passes an update to its parent. Several threads take whole subtrees first, then tiles
// of the fronts above them. The order of all sums is fixed.
#include <algorithm>
#include <atomic>
#include <cstring>
#include <numeric>
#include <type_traits>
#include <vector>

#include "holba/base/check.h"
#include "holba/base/threads.h"
#include "holba/linear/cholesky_factor.h"
#include "holba/linear/elimination.h"
#include "holba/linear/front_inverse.h"
#include "holba/linear/panel_front.h"
#include "holba/linear/update_plan.h"

namespace holba {
namespace {

// The place of a block of S in its front.
struct BlockPlace {
  size_t block;     // in the pattern
  int row, column;  // of its first entry in the front, row >= column
  int row_node, column_node;
  bool transposed;  // the block's rows are the front's columns
};

template <typename Real>
class SparseFactor : public CholeskyFactor {
 public:
  SparseFactor(const BlockPattern& pattern, std::shared_ptr<const Elimination> elimination,
               int num_threads)
      : pattern_(pattern), plan_(std::move(elimination)), num_threads_(NumThreads(num_threads)) {
    LayOutFronts();
    PlaceBlocks();
    PlanTasks();
    PlanUpdates();
    const int num_supernodes = plan_->num_supernodes();
    for (int s = 0; s < num_supernodes; ++s) {
      fronts_[s].front.factor = factor_.data() + fronts_[s].factor_offset;
      fronts_[s].front.update = updates_.data() + fronts_[s].update_offset;
      fronts_[s].front.inverse_diagonal = inverse_diagonal_.data() + fronts_[s].diagonal_offset;
    }
    scale_.assign(pattern.num_unknowns, 1.0);
  }

  bool Factorise(const BlockMatrix& S, const double* scale, double min_pivot) override {
    if (scale != nullptr) std::copy_n(scale, scale_.size(), scale_.data());
    scaled_ = scale != nullptr;
    failed_ = false;
    ++round_;
    const Real pivot = static_cast<Real>(min_pivot);
    for (int s : top_) fronts_[s].tiles_left.store(fronts_[s].num_update_tiles);
    ParallelTasks(num_threads_, tasks_.size(),
                  [&](size_t index) { RunTask(tasks_[index], S, scale, pivot); });
    return !failed_;
  }

  void Solve(const double* b, double* x) override {
    const int threads = factor_.size() < (1 << 17) ? 1 : num_threads_;
    ParallelTasks(threads, subtrees_.size(), [&](size_t i) {
      for (int s = plan_->first_descendant[subtrees_[i]]; s <= subtrees_[i]; ++s) {
        SolveFrontForward(s, b, 1);
      }
    });
    for (int s : top_) SolveFrontForward(s, b, threads);
    for (auto s = top_.rbegin(); s != top_.rend(); ++s) SolveFrontBackward(*s, x, threads);
    ParallelTasks(threads, subtrees_.size(), [&](size_t i) {
      for (int s = subtrees_[i]; s >= plan_->first_descendant[subtrees_[i]]; --s) {
        SolveFrontBackward(s, x, 1);
      }
    });
  }

  void SelectedInverse(BlockMatrix* Z) override {
    if constexpr (std::is_same_v<Real, double>) {
      HOLBA_CHECK(!scaled_ && Z->pattern->num_blocks() == pattern_.num_blocks());
      std::vector<PanelMatrix> inverses(plan_->num_supernodes());
      std::vector<std::atomic<int>> children_left(plan_->num_supernodes());
      for (int s = 0; s < plan_->num_supernodes(); ++s) {
        children_left[s] = static_cast<int>(fronts_[s].children.size());
      }
      const auto run = [&](int s, int threads) {
        InvertFront(s, threads, inverses.data(), Z);
        const int parent = plan_->parent[s];
        if (parent != -1 && --children_left[parent] == 0) inverses[parent] = PanelMatrix();
        if (fronts_[s].children.empty()) inverses[s] = PanelMatrix();
      };
      for (auto s = top_.rbegin(); s != top_.rend(); ++s) run(*s, num_threads_);
      ParallelTasks(num_threads_, subtrees_.size(), [&](size_t i) {
        for (int s = subtrees_[i]; s >= plan_->first_descendant[subtrees_[i]]; --s) run(s, 1);
      });
    } else {
      HOLBA_CHECK_MSG(false, "a selected inverse needs a factor in double");
    }
  }

  double Flops() const override {
    double flops = 0.0;
    for (const Front& f : fronts_) flops += FlopsOf(f);
    return flops;
  }

  size_t MemoryBytes() const override {
    size_t bytes = (factor_.size() + updates_.size() + inverse_diagonal_.size() +
                    right_sides_.size() + lanes_.size()) *
                   sizeof(Real);
    for (const Front& f : fronts_) {
      bytes += sizeof(Front) + f.target.size() * sizeof(int) + f.blocks.size() * sizeof(BlockPlace);
    }
    return bytes + scale_.size() * sizeof(double);
  }

 private:
  static constexpr int kRows = kPanelRows<Real>;

  struct Front {
    PanelFront<Real> front;
    FrontTiling tiling;
    int width = 0;  // unknowns eliminated, and reached, without padding
    int reach = 0;
    std::vector<int> children;
    std::vector<BlockPlace> blocks;
    // Place of each reached unknown in the parent: the first num_into_factor ones are among its
    // eliminated columns, the others among its remaining rows.
    std::vector<int> target;
    int num_into_factor = 0;
    size_t factor_offset = 0, update_offset = 0, diagonal_offset = 0;
    size_t right_side_offset = 0, lanes_offset = 0;
    // For a front that is eliminated by tiles:
    int num_update_tiles = 0;
    std::vector<std::atomic<uint32_t>> tile_done, row_assembled;
    std::atomic<int> tiles_left = 0;
    std::atomic<uint32_t> done = 0;
  };

  struct Task {
    enum class Kind { kSubtree, kAssemble, kEliminate };
    Kind kind;
    int supernode;
    int index = 0;  // tile row, or tile
  };

  static double FlopsOf(const Front& f) {
    const double w = f.front.eliminated, u = f.front.remaining;
    return w * (w * (w / 3.0 + u) + u * u);
  }

  int WidthAt(int position) const { return pattern_.widths[plan_->node_at[position]]; }

  void LayOutFronts() {
    const int num_supernodes = plan_->num_supernodes();
    fronts_ = std::vector<Front>(num_supernodes);
    place_.assign(pattern_.num_nodes(), 0);
    size_t factor_size = 0, diagonal_size = 0, right_side_size = 0;
    for (int s = 0; s < num_supernodes; ++s) {
      Front& f = fronts_[s];
      for (int k = plan_->begin[s]; k < plan_->begin[s + 1]; ++k) {
        place_[k] = f.width;
        f.width += WidthAt(k);
      }
      for (size_t i = plan_->row_begin[s]; i < plan_->row_begin[s + 1]; ++i) {
        f.reach += WidthAt(plan_->row[i]);
      }
      f.front.eliminated = PadToPanels<Real>(f.width);
      f.front.remaining = PadToPanels<Real>(f.reach);
      f.tiling = FrontTiling(f.front.eliminated, f.front.remaining,
                             FrontTiling::TileSize(f.front.eliminated, f.front.remaining));
      f.factor_offset = factor_size;
      f.diagonal_offset = diagonal_size;
      f.right_side_offset = right_side_size;
      f.lanes_offset = diagonal_size * kRows;
      factor_size += PanelFront<Real>::FactorSize(f.front.eliminated, f.front.remaining);
      diagonal_size += f.front.eliminated;
      right_side_size += f.front.eliminated + f.front.remaining;
      if (plan_->parent[s] != -1) fronts_[plan_->parent[s]].children.push_back(s);
    }
    // Parents are laid out by now.
    for (int s = 0; s < num_supernodes; ++s) {
      const int parent = plan_->parent[s];
      if (parent == -1) {
        HOLBA_CHECK(fronts_[s].reach == 0);
        continue;
      }
      Front& f = fronts_[s];
      f.target.reserve(f.reach);
      size_t in_parent = plan_->row_begin[parent];
      int parent_row = 0;  // unknowns of the parent's rows before in_parent
      for (size_t i = plan_->row_begin[s]; i < plan_->row_begin[s + 1]; ++i) {
        const int position = plan_->row[i];
        int first;
        if (position < plan_->begin[parent + 1]) {
          HOLBA_CHECK(position >= plan_->begin[parent]);
          first = place_[position];
          f.num_into_factor += WidthAt(position);
        } else {
          while (plan_->row[in_parent] < position) parent_row += WidthAt(plan_->row[in_parent++]);
          HOLBA_CHECK(plan_->row[in_parent] == position);
          first = parent_row;
        }
        for (int l = 0; l < WidthAt(position); ++l) f.target.push_back(first + l);
      }
    }
    factor_ = FactorMemory<Real>(factor_size);
    inverse_diagonal_ = FactorMemory<Real>(diagonal_size);
    right_sides_ = FactorMemory<Real>(right_side_size);
    lanes_ = FactorMemory<Real>(diagonal_size * kRows);
  }

  // A block belongs to the front that eliminates the earlier one of its nodes.
  void PlaceBlocks() {
    std::vector<int> supernode_of(pattern_.num_nodes());
    for (int s = 0; s < plan_->num_supernodes(); ++s) {
      for (int k = plan_->begin[s]; k < plan_->begin[s + 1]; ++k) supernode_of[k] = s;
    }
    // Sorting blocks by front and by their later node finds all rows in one pass.
    struct Pair {
      int later, earlier;
      size_t block;
    };
    std::vector<size_t> start(plan_->num_supernodes() + 1, 0);
    const auto for_blocks = [&](const auto& body) {
      for (int a = 0; a < pattern_.num_nodes(); ++a) {
        for (size_t k = pattern_.row_start[a]; k < pattern_.row_start[a + 1]; ++k) {
          const int p = plan_->position[a], q = plan_->position[pattern_.column[k]];
          body(std::max(p, q), std::min(p, q), k);
        }
      }
    };
    for_blocks([&](int, int earlier, size_t) { ++start[supernode_of[earlier] + 1]; });
    std::partial_sum(start.begin(), start.end(), start.begin());
    std::vector<Pair> pairs(pattern_.num_blocks());
    std::vector<size_t> next(start.begin(), start.end() - 1);
    for_blocks([&](int later, int earlier, size_t k) {
      pairs[next[supernode_of[earlier]]++] = {later, earlier, k};
    });
    for (int s = 0; s < plan_->num_supernodes(); ++s) {
      Front& f = fronts_[s];
      std::sort(pairs.begin() + start[s], pairs.begin() + start[s + 1],
                [](const Pair& x, const Pair& y) {
                  return x.later != y.later ? x.later < y.later : x.earlier < y.earlier;
                });
      size_t reached = plan_->row_begin[s];
      int row = f.front.eliminated;
      f.blocks.reserve(start[s + 1] - start[s]);
      for (size_t i = start[s]; i < start[s + 1]; ++i) {
        const auto [later, earlier, block] = pairs[i];
        BlockPlace place{block, 0, place_[earlier], plan_->node_at[later], plan_->node_at[earlier],
                         false};
        if (later < plan_->begin[s + 1]) {
          place.row = place_[later];
        } else {
          while (plan_->row[reached] < later) row += WidthAt(plan_->row[reached++]);
          place.row = row;
        }
        place.transposed = place.row_node < place.column_node;
        f.blocks.push_back(place);
      }
    }
  }

  // Subtrees that are small enough to be tasks, and the tiles of the fronts above them.
  void PlanTasks() {
    const int num_supernodes = plan_->num_supernodes();
    std::vector<double> subtree_flops(num_supernodes);
    double total = 0.0;
    for (int s = 0; s < num_supernodes; ++s) {
      // The constants stand for memory traffic and latencies, which dominate small fronts.
      const double own = FlopsOf(fronts_[s]) +
                         20.0 * fronts_[s].front.remaining * fronts_[s].front.remaining + 30e3;
      subtree_flops[s] += own;
      total += own;
      if (plan_->parent[s] != -1) subtree_flops[plan_->parent[s]] += subtree_flops[s];
    }
    is_top_.assign(num_supernodes, 0);
    const double limit = num_threads_ == 1 ? total : total / (8.0 * num_threads_);
    for (int s = num_supernodes - 1; s >= 0; --s) {
      const int parent = plan_->parent[s];
      const bool under_top = parent == -1 || is_top_[parent];
      if (!under_top) continue;
      if (subtree_flops[s] > limit * (1.0 + 1e-9)) {
        is_top_[s] = 1;
      } else {
        subtrees_.push_back(s);
      }
    }
    std::stable_sort(subtrees_.begin(), subtrees_.end(),
                     [&](int a, int b) { return subtree_flops[a] > subtree_flops[b]; });
    for (int s : subtrees_) tasks_.push_back({Task::Kind::kSubtree, s});
    for (int s = 0; s < num_supernodes; ++s) {
      if (!is_top_[s]) continue;
      top_.push_back(s);
      Front& f = fronts_[s];
      f.tile_done = std::vector<std::atomic<uint32_t>>(f.tiling.num_tiles());
      f.row_assembled = std::vector<std::atomic<uint32_t>>(f.tiling.num_rows());
      for (int t = 0; t < f.tiling.num_rows(); ++t) {
        tasks_.push_back({Task::Kind::kAssemble, s, t});
      }
      for (int t = 0; t < f.tiling.num_tiles(); ++t) {
        tasks_.push_back({Task::Kind::kEliminate, s, t});
      }
      f.num_update_tiles = f.tiling.num_tiles();
    }
    // A front that is assembled at once reads S in the order of its memory.
    for (int s = 0; s < num_supernodes; ++s) {
      if (is_top_[s]) continue;
      std::sort(fronts_[s].blocks.begin(), fronts_[s].blocks.end(),
                [](const BlockPlace& x, const BlockPlace& y) { return x.block < y.block; });
    }
  }

  // Places of the updates that fronts pass to their parents.
  void PlanUpdates() {
    std::vector<size_t> sizes;
    for (const Front& f : fronts_) {
      sizes.push_back(PanelFront<Real>::UpdateSize(f.front.remaining));
    }
    const UpdatePlan updates = PlanUpdateMemory(*plan_, subtrees_, sizes);
    for (size_t s = 0; s < fronts_.size(); ++s) fronts_[s].update_offset = updates.offset[s];
    updates_ = FactorMemory<Real>(updates.size);
  }

  void RunTask(const Task& task, const BlockMatrix& S, const double* scale, Real min_pivot) {
    const FlushTinyNumbers flush;
    Front& f = fronts_[task.supernode];
    switch (task.kind) {
      case Task::Kind::kSubtree:
        for (int s = plan_->first_descendant[task.supernode]; s <= task.supernode; ++s) {
          if (failed_.load(std::memory_order_relaxed)) break;
          Assemble(s, 0, fronts_[s].front.num_panels(), S, scale);
          if (!EliminateFront<Real>(fronts_[s].front, fronts_[s].tiling, min_pivot)) failed_ = true;
        }
        f.done.store(round_, std::memory_order_release);
        break;
      case Task::Kind::kAssemble:
        for (int c : f.children) {
          for (int step = 0; fronts_[c].done.load(std::memory_order_acquire) != round_; ++step) {
            SpinWait(step);
          }
        }
        if (!failed_.load(std::memory_order_relaxed)) {
          Assemble(task.supernode, f.tiling.Begin(task.index) / kRows,
                   f.tiling.End(task.index) / kRows, S, scale);
        }
        f.row_assembled[task.index].store(round_, std::memory_order_release);
        break;
      case Task::Kind::kEliminate: {
        const int row = f.tiling.TileAt(task.index).row;
        for (int step = 0; f.row_assembled[row].load(std::memory_order_acquire) != round_; ++step) {
          SpinWait(step);
        }
        EliminateTile<Real>(f.front, f.tiling, task.index, min_pivot, f.tile_done.data(), round_,
                            &failed_);
        if (f.tiles_left.fetch_sub(1, std::memory_order_acq_rel) == 1) {
          f.done.store(round_, std::memory_order_release);
        }
        break;
      }
    }
  }

  // Assembles the panels [first, end) of front s from its blocks of S and its children's updates.
  void Assemble(int s, int first, int end, const BlockMatrix& S, const double* scale) {
    Front& f = fronts_[s];
    const PanelFront<Real>& front = f.front;
    const int own_panels = front.num_eliminated_panels();
    {
      Real* begin = front.FactorPanel(first);
      std::memset(begin, 0, (front.FactorPanel(end) - begin) * sizeof(Real));
    }
    if (end > own_panels) {
      Real* begin = front.UpdatePanel(std::max(first, own_panels) - own_panels);
      std::memset(begin, 0, (front.UpdatePanel(end - own_panels) - begin) * sizeof(Real));
    }
    for (int i = f.width; i < front.eliminated; ++i) {
      if (i / kRows >= first && i / kRows < end) {
        front.FactorPanel(i / kRows)[i * kRows + i % kRows] = Real(1);
      }
    }
    LoadBlocks(f, first * kRows, end * kRows, S, scale);
    for (int c : f.children) AddChild(f, fronts_[c], first * kRows, end * kRows);
  }

  void LoadBlocks(const Front& f, int first_row, int end_row, const BlockMatrix& S,
                  const double* scale) {
    const PanelKernels<Real>& kernels = CurrentPanelKernels<Real>();
    auto it = f.blocks.begin();
    auto last = f.blocks.end();
    if (first_row > 0 || end_row < f.front.eliminated + f.front.remaining) {  // sorted by rows
      const auto is_before = [](const BlockPlace& place, int row) { return place.row < row; };
      it = std::lower_bound(it, last, first_row - BlockPattern::kMaxWidth, is_before);
      last = std::lower_bound(it, last, end_row, is_before);
    }
    for (; it != last; ++it) {
      const BlockPlace& place = *it;
      const int height = pattern_.widths[place.row_node];
      const int width = pattern_.widths[place.column_node];
      const ptrdiff_t stride = PaddedWidth(place.transposed ? width : height);
      const int begin = std::max(place.row, first_row);
      const int end = std::min(place.row + height, end_row);
      for (int row = begin / kRows * kRows; row < end; row += kRows) {
        const int first_lane = std::max(begin - row, 0);
        const int end_lane = std::min(end - row, kRows);
        int num_columns = width;
        if (row < f.front.eliminated) {
          num_columns = std::min(num_columns, row + kRows - place.column);
        }
        const ptrdiff_t into_block = row - place.row;
        const double* row_scale =
            scale == nullptr
                ? nullptr
                : scale + static_cast<ptrdiff_t>(pattern_.offset[place.row_node]) + into_block;
        const double* column_scale =
            scale == nullptr ? nullptr : scale + pattern_.offset[place.column_node];
        Real* panel = f.front.FactorPanel(row / kRows) + static_cast<size_t>(place.column) * kRows;
        if (place.transposed) {
          kernels.load_transposed(S.Block(place.block) + into_block * stride, stride, num_columns,
                                  first_lane, end_lane, row_scale, column_scale, panel);
        } else {
          kernels.load(S.Block(place.block) + into_block, stride, num_columns, first_lane, end_lane,
                       row_scale, column_scale, panel);
        }
      }
    }
  }

  // Adds the update of `child` to the rows [first_row, end_row) of `f`.
  void AddChild(const Front& f, const Front& child, int first_row, int end_row) {
    const PanelKernels<Real>& kernels = CurrentPanelKernels<Real>();
    const PanelFront<Real>& front = f.front;
    const int num_into_factor = child.num_into_factor;
    const int* target = child.target.data();
    const auto row_of = [&](int i) {
      return i < num_into_factor ? target[i] : front.eliminated + target[i];
    };
    const auto first_at_or_past = [&](int row) {
      int low = 0, high = child.reach;
      while (low < high) {
        const int middle = (low + high) / 2;
        if (row_of(middle) < row) {
          low = middle + 1;
        } else {
          high = middle;
        }
      }
      return low;
    };
    const int begin = first_at_or_past(first_row);
    const int end = first_at_or_past(end_row);
    for (int line = begin / kRows * kRows; line < end; line += kRows) {
      const Real* panel = child.front.UpdatePanel(line / kRows);
      const int first_lane = std::max(begin - line, 0);
      const int end_lane = std::min(end - line, kRows);
      size_t in_factor[kRows], in_update[kRows];
      for (int l = first_lane; l < end_lane; ++l) {
        const int i = line + l;
        const int row = row_of(i);
        in_factor[l] = PanelFront<Real>::TrapezoidSize(row / kRows, front.eliminated) + row % kRows;
        if (i >= num_into_factor) {
          in_update[l] = PanelFront<Real>::TrapezoidSize(target[i] / kRows, front.remaining) +
                         target[i] % kRows;
        }
      }
      kernels.scatter_add(panel, std::min(line, num_into_factor), target, first_lane, end_lane,
                          in_factor, front.factor);
      if (line > num_into_factor) {
        kernels.scatter_add(panel + static_cast<size_t>(num_into_factor) * kRows,
                            line - num_into_factor, target + num_into_factor, first_lane, end_lane,
                            in_update, front.update);
      }
      for (int l = first_lane; l < end_lane; ++l) {
        for (int j = line; j <= line + l; ++j) {
          const Real value = panel[static_cast<size_t>(j) * kRows + l];
          if (j < num_into_factor) {
            front.factor[in_factor[l] + static_cast<size_t>(target[j]) * kRows] += value;
          } else {
            front.update[in_update[l] + static_cast<size_t>(target[j]) * kRows] += value;
          }
        }
      }
    }
  }

  void SolveFrontForward(int s, const double* b, int threads) {
    const FlushTinyNumbers flush;
    const Front& f = fronts_[s];
    Real* y = right_sides_.data() + f.right_side_offset;
    std::fill_n(y, f.front.eliminated + f.front.remaining, Real(0));
    for (int k = plan_->begin[s]; k < plan_->begin[s + 1]; ++k) {
      const size_t offset = pattern_.offset[plan_->node_at[k]];
      for (int l = 0; l < WidthAt(k); ++l) {
        y[place_[k] + l] =
            static_cast<Real>(scaled_ ? b[offset + l] * scale_[offset + l] : b[offset + l]);
      }
    }
    for (int c : f.children) {
      const Front& child = fronts_[c];
      const Real* left = right_sides_.data() + child.right_side_offset + child.front.eliminated;
      for (int i = 0; i < child.num_into_factor; ++i) y[child.target[i]] += left[i];
      Real* remaining = y + f.front.eliminated;
      for (int i = child.num_into_factor; i < child.reach; ++i) {
        remaining[child.target[i]] += left[i];
      }
    }
    SolveForward<Real>(f.front, y, threads);
  }

  void SolveFrontBackward(int s, double* x, int threads) {
    const FlushTinyNumbers flush;
    const Front& f = fronts_[s];
    Real* y = right_sides_.data() + f.right_side_offset;
    if (plan_->parent[s] != -1) {
      const Front& parent = fronts_[plan_->parent[s]];
      const Real* from = right_sides_.data() + parent.right_side_offset;
      Real* remaining = y + f.front.eliminated;
      for (int i = 0; i < f.num_into_factor; ++i) remaining[i] = from[f.target[i]];
      from += parent.front.eliminated;
      for (int i = f.num_into_factor; i < f.reach; ++i) remaining[i] = from[f.target[i]];
      std::fill(remaining + f.reach, remaining + f.front.remaining, Real(0));
    }
    SolveBackward<Real>(f.front, y, lanes_.data() + f.lanes_offset, threads);
    for (int k = plan_->begin[s]; k < plan_->begin[s + 1]; ++k) {
      const size_t offset = pattern_.offset[plan_->node_at[k]];
      for (int l = 0; l < WidthAt(k); ++l) {
        const double value = y[place_[k] + l];
        x[offset + l] = scaled_ ? value * scale_[offset + l] : value;
      }
    }
  }

  void InvertFront(int s, int threads, PanelMatrix* inverses, BlockMatrix* Z) {
    const Front& f = fronts_[s];
    PanelMatrix z22(f.front.remaining, f.front.remaining);
    if (plan_->parent[s] != -1) {
      const PanelMatrix& from = inverses[plan_->parent[s]];
      const int shift = fronts_[plan_->parent[s]].front.eliminated;
      const auto row_of = [&](int i) {
        return i < f.num_into_factor ? f.target[i] : shift + f.target[i];
      };
      for (int j = 0; j < f.reach; ++j) {
        for (int i = 0; i < f.reach; ++i) z22(i, j) = from(row_of(i), row_of(j));
      }
    }
    if constexpr (std::is_same_v<Real, double>) {
      inverses[s] = FrontInverse(f.front, z22, threads);
    }
    for (const BlockPlace& place : f.blocks) {
      const int height = pattern_.widths[place.row_node];
      const int width = pattern_.widths[place.column_node];
      if (place.transposed) {
        CopyBlock(inverses[s], place.column, width, place.row, height, PaddedWidth(width),
                  Z->Block(place.block));
      } else {
        CopyBlock(inverses[s], place.row, height, place.column, width, PaddedWidth(height),
                  Z->Block(place.block));
      }
    }
  }

  const BlockPattern& pattern_;
  std::shared_ptr<const Elimination> plan_;
  int num_threads_;
  std::vector<Front> fronts_;
  std::vector<int> place_;           // of each position among its front's eliminated columns
  std::vector<int> subtrees_, top_;  // supernodes: roots of subtrees; those above, children first
  std::vector<char> is_top_;
  std::vector<Task> tasks_;
  FactorMemory<Real> factor_, updates_, inverse_diagonal_, right_sides_, lanes_;
  std::vector<double> scale_;
  bool scaled_ = false;
  std::atomic<bool> failed_ = false;
  uint32_t round_ = 0;
};

}  // namespace

template <typename Real>
std::unique_ptr<CholeskyFactor> MakeSparseFactor(const BlockPattern& pattern,
                                                 std::shared_ptr<const Elimination> elimination,
                                                 int num_threads) {
  return std::make_unique<SparseFactor<Real>>(pattern, std::move(elimination), num_threads);
}
template std::unique_ptr<CholeskyFactor> MakeSparseFactor<double>(
    const BlockPattern&, std::shared_ptr<const Elimination>, int);
template std::unique_ptr<CholeskyFactor> MakeSparseFactor<float>(const BlockPattern&,
                                                                 std::shared_ptr<const Elimination>,
                                                                 int);

}  // namespace holba
