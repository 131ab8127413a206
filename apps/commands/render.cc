// SPDX-License-Identifier: BSD-3-Clause
// holba render: photographs of a small room with known cameras, or of a place with exact truth.
#include <filesystem>
#include <string>
#include <string_view>

#include "apps/command.h"
#include "apps/render/place_set.h"
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
        ->Field("output_path", &output_path_,
                "Folder to write photographs (images) and the model of what is true (truth) to.")
        .Required();
    table->Field("preset", &preset_,
                 "Place to photograph, by its name: small_room, room_1 to room_8, facade_1 to "
                 "facade_8, hall, corridor, plain_room or table.");
    table->Field("seed", &room_.seed, AnyValue(), "Another seed, another place of the same kind.");
    table->Field("num_threads", &num_threads_, AtLeast(-1),
                 "Threads; -1: one per hardware thread.");
    place_.Describe(table);
    room_.Describe(table);
  }

  void ProbeOutputs(const Invocation&) const override {
    ProbeFolder(output_path_, [](std::string_view) { return false; });
    ProbeModelFolder(std::filesystem::path(output_path_) / kTruth);
  }

  void Run(const Invocation&) override {
    StagedFolder stage(output_path_);
    if (preset_ == kSmallRoom) {
      RenderSmallRoom(&stage);
    } else {
      RenderPlaceSet(preset_, room_.seed, place_, num_threads_, &stage);
    }
    stage.Commit(IsPlaceSetFile);
    LogInfo("Wrote images and truth to {}", output_path_);
  }

 private:
  static constexpr std::string_view kImages = "images", kTruth = "truth", kSmallRoom = "small_room";

  void RenderSmallRoom(StagedFolder* stage) const {
    const RenderedRoom room = RenderRoom(room_, num_threads_);
    StageModel(room.truth, ModelFormat::kText, std::string(kTruth) + '/', stage);
    std::filesystem::create_directories(stage->path() / kImages);
    for (const RenderedPhotograph& photograph : room.photographs) {
      WriteImage({photograph.width, photograph.height, photograph.rgb},
                 stage->path() / kImages / photograph.name);
    }
  }

  std::string output_path_, preset_ = std::string(kSmallRoom);
  RoomOptions room_;
  PlaceSetOptions place_;
  int num_threads_ = -1;
};

}  // namespace

Command RenderCommand() {
  return {.name = "render",
          .summary = "Make photographs of man-made places with everything that is true of them",
          .details =
              "Without a preset (small_room): a corner of a room with painted walls and boxes, "
              "drawn in "
              "a second, with its cameras (options Room.*).\n"
              "With room_1 to room_8, facade_1 to facade_8, hall, corridor, plain_room or table "
              "(options Camera.*, Walk.*, Photo.*): photographs as of a real place, with cameras, "
              "edges, "
              "planes, primitives and what ties them together as a model (truth), the surfaces "
              "(mesh.ply, metres), depth, normals and labels (docs/render.md).\n"
              "Photographs have no EXIF, so that the focal length is unknown.",
          .make_job = [] { return std::make_unique<RenderJob>(); }};
}

}  // namespace holba
