// SPDX-License-Identifier: BSD-3-Clause
// holba render: photographs of a small room with known cameras.
#include <filesystem>
#include <string>
#include <string_view>

#include "apps/command.h"
#include "holba/base/log.h"
#include "holba/base/words.h"
#include "holba/frontend/photographs/photograph.h"
#include "holba/io/files.h"
#include "holba/io/model_io.h"
#include "holba/synthetic/rendered_room.h"

namespace holba {
namespace {

class RenderJob : public Job {
 public:
  void Describe(OptionTable* table) const override {
    table
        ->Field(
            "output_path", &output_path_,
            "Folder to write the photographs (images) and the model of their cameras (truth) to.")
        .Required();
    table->Field("seed", &room_.seed, AnyValue(), "Seed of the paint and of the noise.");
    table->Field("num_threads", &num_threads_, AtLeast(-1),
                 "Threads; -1: one per hardware thread.");
    room_.Describe(table);
  }

  void ProbeOutputs(const Invocation&) const override {
    ProbeFolder(output_path_, [](std::string_view) { return false; });
    ProbeModelFolder(std::filesystem::path(output_path_) / kTruth);
  }

  void Run(const Invocation&) override {
    const RenderedRoom room = RenderRoom(room_, num_threads_);
    StagedFolder stage(output_path_);
    StageModel(room.truth, ModelFormat::kText, std::string(kTruth) + '/', &stage);
    std::filesystem::create_directories(stage.path() / kImages);
    for (const RenderedPhotograph& photograph : room.photographs) {
      WriteImage({photograph.width, photograph.height, photograph.rgb},
                 stage.path() / kImages / photograph.name);
    }
    stage.Commit([](std::string_view name) {
      const size_t slash = name.find('/');
      return name == kImages ||
             (slash != std::string_view::npos && name.substr(0, slash) == kTruth &&
              IsModelFile(name.substr(slash + 1)));
    });
    LogInfo("Wrote {} and the model truth to {}", Counted(room.photographs.size(), "photograph"),
            output_path_);
  }

 private:
  static constexpr std::string_view kImages = "images", kTruth = "truth";

  std::string output_path_;
  RoomOptions room_;
  int num_threads_ = -1;
};

}  // namespace

Command RenderCommand() {
  return {.name = "render",
          .summary = "Make photographs of a small room with known cameras",
          .details =
              "Draws a corner of a room with painted walls and boxes, as a lens with distortion "
              "sees it: photographs for demonstrations\n"
              "and tests, with the true cameras beside them. They have no EXIF, so that the focal "
              "length is unknown.",
          .make_job = [] { return std::make_unique<RenderJob>(); }};
}

}  // namespace holba
