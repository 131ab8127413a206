// SPDX-License-Identifier: BSD-3-Clause
#include "holba/linear/elimination.h"

#include <metis.h>

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <numeric>
#include <utility>

#include "holba/base/check.h"
#include "holba/linear/reduced_solver.h"

namespace holba {
namespace {

// Neighbours of each node, without the node.
struct Graph {
  std::vector<int> begin;
  std::vector<int> neighbour;
  const std::vector<int>* widths;

  int num_nodes() const { return static_cast<int>(begin.size()) - 1; }
  size_t num_edges() const { return neighbour.size() / 2; }
};

Graph GraphOf(const BlockPattern& pattern) {
  const int n = pattern.num_nodes();
  Graph graph{std::vector<int>(n + 1, 0), {}, &pattern.widths};
  for (int a = 0; a < n; ++a) {
    graph.begin[a + 1] += pattern.row_start[a + 1] - pattern.row_start[a] - 1;
    for (size_t k = pattern.row_start[a]; k + 1 < pattern.row_start[a + 1]; ++k) {
      ++graph.begin[pattern.column[k] + 1];
    }
  }
  std::partial_sum(graph.begin.begin(), graph.begin.end(), graph.begin.begin());
  graph.neighbour.resize(graph.begin[n]);
  std::vector<int> next(graph.begin.begin(), graph.begin.end() - 1);
  // Rows ascend, and so do the neighbours of each node: first those before it, then those after.
  for (int a = 0; a < n; ++a) {
    for (size_t k = pattern.row_start[a]; k + 1 < pattern.row_start[a + 1]; ++k) {
      const int b = pattern.column[k];
      graph.neighbour[next[a]++] = b;
      graph.neighbour[next[b]++] = a;
    }
  }
  return graph;
}

std::vector<int> MinimumDegreeOrder(const Graph& graph) {
  using Matrix = Eigen::SparseMatrix<signed char, Eigen::ColMajor, int>;
  const int n = graph.num_nodes();
  // Lower triangle, with the diagonal: Eigen puts nodes without one at the end.
  Matrix matrix(n, n);
  matrix.resizeNonZeros(graph.num_edges() + n);
  int* end = matrix.innerIndexPtr();
  for (int v = 0; v < n; ++v) {
    matrix.outerIndexPtr()[v] = static_cast<int>(end - matrix.innerIndexPtr());
    *end++ = v;
    const auto last = graph.neighbour.begin() + graph.begin[v + 1];
    end = std::copy(std::lower_bound(graph.neighbour.begin() + graph.begin[v], last, v), last, end);
  }
  matrix.outerIndexPtr()[n] = static_cast<int>(end - matrix.innerIndexPtr());
  std::fill_n(matrix.valuePtr(), matrix.nonZeros(), 1);
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> permutation;
  Eigen::AMDOrdering<int>()(matrix.selfadjointView<Eigen::Lower>(), permutation);
  return {permutation.indices().data(), permutation.indices().data() + n};
}

// Empty if METIS fails.
std::vector<int> NestedDissectionOrder(const Graph& graph) {
  idx_t n = graph.num_nodes();
  std::vector<idx_t> begin(graph.begin.begin(), graph.begin.end());
  std::vector<idx_t> neighbour(graph.neighbour.begin(), graph.neighbour.end());
  std::vector<idx_t> weight(graph.widths->begin(), graph.widths->end());
  std::vector<idx_t> order(n), position(n);
  idx_t options[METIS_NOPTIONS];
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_NUMBERING] = 0;
  options[METIS_OPTION_SEED] = 1;
  if (METIS_NodeND(&n, begin.data(), neighbour.data(), weight.data(), options, order.data(),
                   position.data()) != METIS_OK) {
    return {};
  }
  return {order.begin(), order.end()};
}

std::vector<int> Inverse(const std::vector<int>& order) {
  std::vector<int> position(order.size());
  for (size_t i = 0; i < order.size(); ++i) position[order[i]] = static_cast<int>(i);
  return position;
}

// Parents in the elimination tree, by position (Liu 1990, with compressed paths).
std::vector<int> EliminationTree(const Graph& graph, const std::vector<int>& order,
                                 const std::vector<int>& position) {
  const int n = graph.num_nodes();
  std::vector<int> parent(n, -1), ancestor(n, -1);
  for (int k = 0; k < n; ++k) {
    const int node = order[k];
    for (int e = graph.begin[node]; e < graph.begin[node + 1]; ++e) {
      for (int i = position[graph.neighbour[e]]; i != -1 && i < k;) {
        const int next = ancestor[i];
        ancestor[i] = k;
        if (next == -1) parent[i] = k;
        i = next;
      }
    }
  }
  return parent;
}

// Vertices of a forest, children (in ascending order) before parents.
std::vector<int> Postorder(const std::vector<int>& parent) {
  const int n = static_cast<int>(parent.size());
  std::vector<int> first_child(n, -1), next_sibling(n, -1), roots, order, stack;
  for (int v = n - 1; v >= 0; --v) {
    if (parent[v] == -1) {
      roots.push_back(v);
    } else {
      next_sibling[v] = first_child[parent[v]];
      first_child[parent[v]] = v;
    }
  }
  order.reserve(n);
  for (auto root = roots.rbegin(); root != roots.rend(); ++root) {
    stack.push_back(*root);
    while (!stack.empty()) {
      const int v = stack.back();
      if (first_child[v] != -1) {
        stack.push_back(first_child[v]);
        first_child[v] = next_sibling[first_child[v]];
      } else {
        order.push_back(v);
        stack.pop_back();
      }
    }
  }
  return order;
}

struct Columns {
  std::vector<int> order;  // postordered
  std::vector<int> position;
  std::vector<int> parent;
  std::vector<int> height;  // unknowns of each column of the factor, the node's own included
  double flops = 0.0;
};

// Additions and multiplications of eliminating `width` unknowns that reach height - width others.
double EliminationFlops(double width, double height) {
  const double below = height - width;
  return width * (width * (width / 3.0 + below) + below * below);
}

// Heights of the columns by counting the leaves of row subtrees (Gilbert, Ng and Peyton 1994),
// every row counted with its width.
Columns CountColumns(const Graph& graph, std::vector<int> order) {
  const int n = graph.num_nodes();
  Columns columns;
  {
    const std::vector<int> parent = EliminationTree(graph, order, Inverse(order));
    const std::vector<int> post = Postorder(parent);
    const std::vector<int> rank = Inverse(post);
    columns.order.resize(n);
    columns.parent.resize(n);
    for (int k = 0; k < n; ++k) {
      columns.order[k] = order[post[k]];
      columns.parent[k] = parent[post[k]] == -1 ? -1 : rank[parent[post[k]]];
    }
  }
  columns.position = Inverse(columns.order);
  const std::vector<int>& parent = columns.parent;
  const auto width = [&](int k) { return (*graph.widths)[columns.order[k]]; };

  std::vector<int> first(n, -1);  // first descendant
  std::vector<int64_t> delta(n, 0);
  for (int k = 0; k < n; ++k) {
    const bool leaf = first[k] == -1;
    if (leaf) delta[k] = width(k);
    for (int j = k; j != -1 && first[j] == -1; j = parent[j]) first[j] = k;
  }
  std::vector<int> max_first(n, -1), previous_leaf(n, -1), ancestor(n);
  std::iota(ancestor.begin(), ancestor.end(), 0);
  for (int j = 0; j < n; ++j) {
    if (parent[j] != -1) delta[parent[j]] -= width(j);
    const int node = columns.order[j];
    for (int e = graph.begin[node]; e < graph.begin[node + 1]; ++e) {
      const int i = columns.position[graph.neighbour[e]];
      if (i <= j || first[j] <= max_first[i]) continue;  // j is no leaf of the subtree of row i
      max_first[i] = first[j];
      delta[j] += width(i);
      const int previous = std::exchange(previous_leaf[i], j);
      if (previous == -1) continue;
      int meet = previous;
      while (meet != ancestor[meet]) meet = ancestor[meet];
      for (int v = previous; v != meet;) v = std::exchange(ancestor[v], meet);
      delta[meet] -= width(i);
    }
    if (parent[j] != -1) ancestor[j] = parent[j];
  }
  for (int j = 0; j < n; ++j) {
    if (parent[j] != -1) delta[parent[j]] += delta[j];
  }
  columns.height.assign(delta.begin(), delta.end());
  for (int j = 0; j < n; ++j) columns.flops += EliminationFlops(width(j), columns.height[j]);
  return columns;
}

// Cost of a search by METIS in operations of a factorisation. The search is made where ten
// factorisations with half the operations would repay it.
double NestedDissectionCost(const Graph& graph) {
  constexpr double kFlopsPerEdge = 20e3;
  constexpr double kFlopsPerNode = 100e3;
  return kFlopsPerEdge * graph.num_edges() + kFlopsPerNode * graph.num_nodes();
}

Columns ChooseOrder(const Graph& graph, Ordering ordering) {
  constexpr double kFactorisations = 10.0;
  Columns best;
  if (graph.num_nodes() == 0) return best;
  if (ordering != Ordering::kNestedDissection) {
    best = CountColumns(graph, MinimumDegreeOrder(graph));
    if (ordering == Ordering::kMinimumDegree) return best;
    if (0.5 * kFactorisations * best.flops < NestedDissectionCost(graph)) return best;
    // Nothing to gain where the factor is nearly full anyway.
    double n = 0.0;
    for (int width : *graph.widths) n += width;
    if (best.flops > 0.8 * n * n * n / 3.0) return best;
  }
  std::vector<int> order = NestedDissectionOrder(graph);
  if (order.empty())
    return best.order.empty() ? ChooseOrder(graph, Ordering::kMinimumDegree) : best;
  Columns other = CountColumns(graph, std::move(order));
  return best.order.empty() || other.flops < best.flops ? other : best;
}

// Approximate time of a front in nanoseconds: products, assembly, latencies. The choice of fronts
// hardly depends on these numbers.
double FrontCost(double width, double height) {
  constexpr double kPerFlop = 0.02;
  constexpr double kPerAssembledEntry = 0.3;
  constexpr double kPerEntry = 0.12;
  constexpr double kPerColumn = 15.0;
  constexpr double kPerFront = 500.0;
  const auto padded = [](double n) { return 8.0 * static_cast<int>((n + 7.0) / 8.0); };
  const double w = padded(width), u = padded(height - width);
  return kPerFlop * EliminationFlops(w, w + u) + 0.5 * kPerAssembledEntry * u * u +
         0.5 * kPerEntry * (w + u) * (w + u) + kPerColumn * w + kPerFront;
}

// Fronts of the elimination before they are numbered.
struct Fronts {
  std::vector<int> of_column;  // front of each column
  std::vector<int> width, height, last_column, parent;
  std::vector<int> merged_into;  // -1: it stays

  int size() const { return static_cast<int>(width.size()); }
};

// A front for each run of columns with the same rows below them.
Fronts FindFronts(const BlockPattern& pattern, const Columns& columns) {
  Fronts fronts;
  const int n = static_cast<int>(columns.order.size());
  const auto width = [&](int k) { return pattern.widths[columns.order[k]]; };
  fronts.of_column.resize(n);
  for (int k = 0; k < n; ++k) {
    const bool joins = k > 0 && columns.parent[k - 1] == k &&
                       columns.height[k - 1] - width(k - 1) == columns.height[k];
    if (!joins) {
      fronts.width.push_back(0);
      fronts.height.push_back(columns.height[k]);
      fronts.last_column.push_back(k);
    }
    fronts.of_column[k] = fronts.size() - 1;
    fronts.width.back() += width(k);
    fronts.last_column.back() = k;
  }
  fronts.parent.assign(fronts.size(), -1);
  fronts.merged_into.assign(fronts.size(), -1);
  for (int f = 0; f < fronts.size(); ++f) {
    const int above = columns.parent[fronts.last_column[f]];
    if (above != -1) fronts.parent[f] = fronts.of_column[above];
  }
  return fronts;
}

// Merges fronts into their parents where one front costs less than two.
void MergeFronts(Fronts* fronts) {
  std::vector<int>&width = fronts->width, &height = fronts->height;
  std::vector<std::vector<int>> children(fronts->size());
  for (int f = 0; f < fronts->size(); ++f) {
    if (fronts->parent[f] != -1) children[fronts->parent[f]].push_back(f);
  }
  for (int p = 0; p < fronts->size(); ++p) {
    // The children that reach most of the parent first; of equal ones the earlier.
    std::vector<int> order = children[p];
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b) { return height[a] - width[a] > height[b] - width[b]; });
    for (int c : order) {
      const int merged_width = width[c] + width[p];
      const int merged_height = width[c] + height[p];
      if (FrontCost(merged_width, merged_height) >
          FrontCost(width[c], height[c]) + FrontCost(width[p], height[p]))
        continue;
      fronts->merged_into[c] = p;
      width[p] = merged_width;
      height[p] = merged_height;
    }
  }
  std::vector<int>&merged_into = fronts->merged_into, &parent = fronts->parent;
  for (int f = fronts->size() - 1; f >= 0; --f) {  // parents first
    if (merged_into[f] != -1 && merged_into[merged_into[f]] != -1)
      merged_into[f] = merged_into[merged_into[f]];
    if (parent[f] != -1 && merged_into[parent[f]] != -1) parent[f] = merged_into[parent[f]];
  }
}

// Numbers the remaining fronts as supernodes, children first; the nodes of each keep their order.
void NumberSupernodes(const Columns& columns, const Fronts& fronts, Elimination* out) {
  std::vector<int> kept, rank(fronts.size(), -1), kept_parent;
  for (int f = 0; f < fronts.size(); ++f) {
    if (fronts.merged_into[f] != -1) continue;
    rank[f] = static_cast<int>(kept.size());
    kept.push_back(f);
  }
  for (int f : kept)
    kept_parent.push_back(fronts.parent[f] == -1 ? -1 : rank[fronts.parent[f]]);
  const std::vector<int> post = Postorder(kept_parent);
  const std::vector<int> supernode_of_kept = Inverse(post);
  const int num_supernodes = static_cast<int>(kept.size());
  std::vector<std::vector<int>> members(num_supernodes);
  for (size_t k = 0; k < columns.order.size(); ++k) {
    const int f = fronts.of_column[k];
    const int owner = fronts.merged_into[f] == -1 ? f : fronts.merged_into[f];
    members[supernode_of_kept[rank[owner]]].push_back(columns.order[k]);
  }
  out->begin.push_back(0);
  for (int s = 0; s < num_supernodes; ++s) {
    const int old_parent = kept_parent[post[s]];
    out->parent.push_back(old_parent == -1 ? -1 : supernode_of_kept[old_parent]);
    out->node_at.insert(out->node_at.end(), members[s].begin(), members[s].end());
    out->begin.push_back(static_cast<int>(out->node_at.size()));
  }
  out->position = Inverse(out->node_at);
  out->first_descendant.resize(num_supernodes);
  std::iota(out->first_descendant.begin(), out->first_descendant.end(), 0);
  for (int s = 0; s < num_supernodes; ++s) {
    const int p = out->parent[s];
    if (p == -1) continue;
    HOLBA_CHECK(p > s);
    out->first_descendant[p] = std::min(out->first_descendant[p], out->first_descendant[s]);
  }
}

// The rows of each supernode: the neighbours of its nodes and the rows of its children.
void FindRows(const Graph& graph, Elimination* out) {
  const int num_supernodes = out->num_supernodes();
  std::vector<int> mark(graph.num_nodes(), -1), rows;
  std::vector<std::vector<int>> children(num_supernodes);
  out->row_begin.push_back(0);
  for (int s = 0; s < num_supernodes; ++s) {
    rows.clear();
    const int end = out->begin[s + 1];
    const auto add = [&](int position) {
      if (position < end || mark[position] == s) return;
      mark[position] = s;
      rows.push_back(position);
    };
    for (int k = out->begin[s]; k < end; ++k) {
      const int node = out->node_at[k];
      for (int e = graph.begin[node]; e < graph.begin[node + 1]; ++e)
        add(out->position[graph.neighbour[e]]);
    }
    for (int c : children[s]) {
      for (size_t i = out->row_begin[c]; i < out->row_begin[c + 1]; ++i) add(out->row[i]);
    }
    std::sort(rows.begin(), rows.end());
    out->row.insert(out->row.end(), rows.begin(), rows.end());
    out->row_begin.push_back(out->row.size());
    if (out->parent[s] != -1) children[out->parent[s]].push_back(s);
  }
}

}  // namespace

std::shared_ptr<const Elimination> PlanElimination(const BlockPattern& pattern, Ordering ordering) {
  const Graph graph = GraphOf(pattern);
  const Columns columns = ChooseOrder(graph, ordering);
  Fronts fronts = FindFronts(pattern, columns);
  MergeFronts(&fronts);
  auto result = std::make_shared<Elimination>();
  result->flops = columns.flops;
  NumberSupernodes(columns, fronts, result.get());
  FindRows(graph, result.get());
  return result;
}

double PredictSparseFlops(const BlockPattern& pattern) {
  return ChooseOrder(GraphOf(pattern), Ordering::kBest).flops;
}

}  // namespace holba
