// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/solve_journal.h"

#include <fmt/format.h>

#include <cstring>
#include <type_traits>
#include <utility>

#include "holba/base/check.h"
#include "holba/base/error.h"

namespace holba {
namespace {

constexpr std::string_view kMagic = "holba checkpoint 1\n";
constexpr char kLoopName[] = "loop.bin";

// FNV-1a, over words of 8 bytes and what is left.
class Hash {
 public:
  void Add(const void* data, size_t size) {
    const char* bytes = static_cast<const char*>(data);
    for (; size >= sizeof(uint64_t); size -= sizeof(uint64_t), bytes += sizeof(uint64_t)) {
      uint64_t word = 0;
      std::memcpy(&word, bytes, sizeof(word));
      Mix(word);
    }
    for (; size > 0; --size) Mix(static_cast<unsigned char>(*bytes++));
  }
  template <typename T>
  void Add(const T& value)
    requires std::is_arithmetic_v<T>
  {
    Add(&value, sizeof(value));
  }
  uint64_t Get() const { return hash_; }

 private:
  void Mix(uint64_t word) { hash_ = (hash_ ^ word) * 0x100000001B3; }
  uint64_t hash_ = 0xCBF29CE484222325;
};

uint64_t HashOf(const Problem& problem) {
  Hash hash;
  hash.Add(problem.num_blocks());
  for (BlockId id = 0; id < problem.num_blocks(); ++id) {
    const ParameterBlock& block = problem.block(id);
    hash.Add(static_cast<int>(block.role));
    hash.Add(block.manifold->ambient);
    hash.Add(block.FreeMask());
  }
  for (const auto& batch : problem.batches()) {
    hash.Add(batch->term().data(), batch->term().size());
    hash.Add(batch->blocks().data(), batch->blocks().size_bytes());
    hash.Add(static_cast<int>(batch->loss.type));
    hash.Add(batch->loss.scale);
    hash.Add(batch->weight);
  }
  hash.Add(problem.state().data(), problem.state().size() * sizeof(double));
  return hash.Get();
}

// One list of the fields for both directions: Visit(archive) calls archive(field) for each.
template <typename Archive, typename Class>
void Visit(Archive& archive, Class& c)
  requires std::is_same_v<std::remove_const_t<Class>, TermCost>
{
  archive(c.term, c.angular, c.residuals, c.absent, c.sum_squares, c.cost);
}
template <typename Archive, typename Class>
void Visit(Archive& archive, Class& c)
  requires std::is_same_v<std::remove_const_t<Class>, SolverSummary>
{
  archive(c.backend, c.linear_solver, c.num_threads, c.stop_reason, c.message, c.iterations,
          c.accepted_steps, c.initial_cost, c.final_cost, c.initial_terms, c.final_terms,
          c.build_seconds, c.linearise_seconds, c.eliminate_seconds, c.factorise_seconds,
          c.back_substitute_seconds, c.total_seconds, c.iteration_seconds, c.reduced_system,
          c.ranks);
}
template <typename Archive, typename Class>
void Visit(Archive& archive, Class& c)
  requires std::is_same_v<std::remove_const_t<Class>, LoopState>
{
  archive(c.radius, c.shrink, c.cost, c.state, c.remembered, c.summary);
}

class Writer {
 public:
  template <typename... Fields>
  void operator()(const Fields&... fields) {
    (Put(fields), ...);
  }
  std::string Take() { return std::move(bytes_); }

 private:
  template <typename T>
  void Put(const T& value) {
    if constexpr (std::is_trivially_copyable_v<T>) {
      bytes_.append(reinterpret_cast<const char*>(&value), sizeof(value));
    } else {
      Visit(*this, value);
    }
  }
  void Put(const std::string& text) {
    Put(static_cast<uint64_t>(text.size()));
    bytes_ += text;
  }
  template <typename T>
  void Put(const std::vector<T>& list) {
    Put(static_cast<uint64_t>(list.size()));
    for (const T& value : list) Put(value);
  }
  std::string bytes_;
};

// Of bytes whose hash is right: their lengths are.
class Reader {
 public:
  explicit Reader(std::string_view bytes) : bytes_(bytes) {}
  template <typename... Fields>
  void operator()(Fields&... fields) {
    (Get(fields), ...);
  }

 private:
  std::string_view Take(size_t size) {
    HOLBA_CHECK_MSG(size <= bytes_.size(), "a checkpoint of another version");
    const std::string_view taken = bytes_.substr(0, size);
    bytes_.remove_prefix(size);
    return taken;
  }
  template <typename T>
  void Get(T& value) {
    if constexpr (std::is_trivially_copyable_v<T>) {
      std::memcpy(static_cast<void*>(&value), Take(sizeof(value)).data(), sizeof(value));
    } else {
      Visit(*this, value);
    }
  }
  void Get(std::string& text) {
    uint64_t size = 0;
    Get(size);
    text = Take(size);
  }
  template <typename T>
  void Get(std::vector<T>& list) {
    uint64_t size = 0;
    Get(size);
    list.clear();
    for (uint64_t i = 0; i < size; ++i) Get(list.emplace_back());
  }
  std::string_view bytes_;
};

uint64_t HashOf(std::string_view bytes) {
  Hash hash;
  hash.Add(bytes.data(), bytes.size());
  return hash.Get();
}

}  // namespace

// A solve that is done, or under way.
struct SolveJournal::Record {
  uint64_t solve_idx = 0, problem_hash = 0;
  LoopState loop;
};

SolveJournal::SolveJournal(Store store, int interval, bool resume)
    : store_(std::move(store)), interval_(interval), resume_(resume) {
  HOLBA_CHECK(interval > 0);
}

std::string SolveJournal::SolveName() const { return fmt::format("solve_{:04}.bin", solve_idx_); }

std::optional<SolverSummary> SolveJournal::Begin(Problem* problem) {
  problem_hash_ = HashOf(*problem);
  loop_.reset();
  if (!resume_) return std::nullopt;
  const auto belongs = [&](const std::optional<Record>& record, const std::string& name) {
    if (!record || record->solve_idx != solve_idx_) return false;
    if (record->problem_hash != problem_hash_ ||
        record->loop.state.size() != problem->state().size()) {
      throw InputError(store_.folder / name,
                       "this checkpoint belongs to another adjustment; give the input and the "
                       "options that it was made with, or leave out --resume");
    }
    return true;
  };
  std::optional<Record> done = Read(SolveName());
  if (belongs(done, SolveName())) {
    problem->state() = std::move(done->loop.state);
    ++solve_idx_;
    return std::move(done->loop.summary);
  }
  std::optional<Record> under_way = Read(kLoopName);
  if (belongs(under_way, kLoopName)) loop_ = std::move(under_way->loop);
  resume_ = false;  // what follows has not been done yet
  return std::nullopt;
}

void SolveJournal::End(const Problem& problem, const SolverSummary& summary) {
  Record record{solve_idx_, problem_hash_, {}};
  record.loop.state = problem.state();
  record.loop.summary = summary;
  Write(SolveName(), record);
  ++solve_idx_;
}

void SolveJournal::Save(const LoopState& loop) {
  Write(kLoopName, {solve_idx_, problem_hash_, loop});
}

void SolveJournal::Write(const std::string& name, const Record& record) const {
  Writer writer;
  writer(record.solve_idx, record.problem_hash, record.loop);
  const std::string content = writer.Take();
  Writer framed;
  framed(static_cast<uint64_t>(content.size()), HashOf(content));
  store_.write(name, std::string(kMagic) + framed.Take() + content);
}

std::optional<SolveJournal::Record> SolveJournal::Read(const std::string& name) const {
  const std::optional<std::string> bytes = store_.read(name);
  if (!bytes) return std::nullopt;
  std::string_view rest = *bytes;
  uint64_t size = 0, hash = 0;
  const size_t header = kMagic.size() + sizeof(size) + sizeof(hash);
  if (!rest.starts_with(kMagic.substr(0, rest.size()))) {
    throw InputError(
        store_.folder / name,
        "this is no checkpoint of this version of holba; remove it, or leave out --resume");
  }
  if (rest.size() >= header) {
    Reader reader(rest.substr(kMagic.size()));
    reader(size, hash);
    rest.remove_prefix(header);
  }
  if (bytes->size() < header || rest.size() < size) {
    throw InputError(store_.folder / name,
                     "the checkpoint is cut short; bring back the whole file, or remove it to go "
                     "on from what was done before");
  }
  if (rest.size() != size || HashOf(rest) != hash) {
    throw InputError(store_.folder / name,
                     "the checkpoint is damaged; bring back the file as it was, or remove it to go "
                     "on from what was done before");
  }
  Record record;
  Reader reader(rest);
  reader(record.solve_idx, record.problem_hash, record.loop);
  return record;
}

}  // namespace holba
