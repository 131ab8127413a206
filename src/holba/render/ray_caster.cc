// SPDX-License-Identifier: BSD-3-Clause
#include "holba/render/ray_caster.h"

#if HOLBA_EMBREE_MAJOR == 3
#include <embree3/rtcore.h>
#else
#include <embree4/rtcore.h>
#endif

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "holba/base/check.h"

namespace holba {
namespace {

using Eigen::Vector3d;

// Curved surfaces, as a geometry of Embree whose intersections are ours.
struct CurvedSurfaces {
  std::span<const Surface> surfaces;
  std::vector<int> idxs;  // of its primitives
};

Vector3d Origin(const RTCRay& ray) { return {ray.org_x, ray.org_y, ray.org_z}; }
Vector3d Direction(const RTCRay& ray) { return {ray.dir_x, ray.dir_y, ray.dir_z}; }

void CurvedBounds(const RTCBoundsFunctionArguments* args) {
  const auto* curved = static_cast<const CurvedSurfaces*>(args->geometryUserPtr);
  Vector3d low, high;
  Bounds(curved->surfaces[static_cast<size_t>(curved->idxs[args->primID])], &low, &high);
  // A little larger, for the rounding to floats.
  const double margin =
      1e-5 * (1.0 + std::max(low.cwiseAbs().maxCoeff(), high.cwiseAbs().maxCoeff()));
  RTCBounds* bounds = args->bounds_o;
  bounds->lower_x = static_cast<float>(low.x() - margin);
  bounds->lower_y = static_cast<float>(low.y() - margin);
  bounds->lower_z = static_cast<float>(low.z() - margin);
  bounds->upper_x = static_cast<float>(high.x() + margin);
  bounds->upper_y = static_cast<float>(high.y() + margin);
  bounds->upper_z = static_cast<float>(high.z() + margin);
}

void CurvedIntersect(const RTCIntersectFunctionNArguments* args) {
  if (args->valid[0] == 0) return;
  const auto* curved = static_cast<const CurvedSurfaces*>(args->geometryUserPtr);
  auto* ray_hit = reinterpret_cast<RTCRayHit*>(args->rayhit);
  RTCRay& ray = ray_hit->ray;
  const auto distance =
      Intersect(curved->surfaces[static_cast<size_t>(curved->idxs[args->primID])], Origin(ray),
                Direction(ray), static_cast<double>(ray.tnear), static_cast<double>(ray.tfar));
  if (!distance) return;
  ray.tfar = static_cast<float>(*distance);
  ray_hit->hit.geomID = args->geomID;
  ray_hit->hit.primID = args->primID;
}

void CurvedOccluded(const RTCOccludedFunctionNArguments* args) {
  if (args->valid[0] == 0) return;
  const auto* curved = static_cast<const CurvedSurfaces*>(args->geometryUserPtr);
  auto* ray = reinterpret_cast<RTCRay*>(args->ray);
  if (Intersect(curved->surfaces[static_cast<size_t>(curved->idxs[args->primID])], Origin(*ray),
                Direction(*ray), static_cast<double>(ray->tnear), static_cast<double>(ray->tfar))) {
    ray->tfar = -std::numeric_limits<float>::infinity();
  }
}

RTCRay MakeRay(const Vector3d& from, const Vector3d& ray, double near, double far) {
  RTCRay made{};
  made.org_x = static_cast<float>(from.x());
  made.org_y = static_cast<float>(from.y());
  made.org_z = static_cast<float>(from.z());
  made.dir_x = static_cast<float>(ray.x());
  made.dir_y = static_cast<float>(ray.y());
  made.dir_z = static_cast<float>(ray.z());
  made.tnear = static_cast<float>(near);
  made.tfar = static_cast<float>(far);
  made.mask = 0xffffffffu;
  return made;
}

}  // namespace

struct RayCaster::Embree {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  unsigned flat_id = RTC_INVALID_GEOMETRY_ID, curved_id = RTC_INVALID_GEOMETRY_ID;
  std::vector<int> flat_idxs;
  CurvedSurfaces curved;

  ~Embree() {
    if (scene != nullptr) rtcReleaseScene(scene);
    if (device != nullptr) rtcReleaseDevice(device);
  }

  bool Occluded(RTCRay ray) const {
#if HOLBA_EMBREE_MAJOR == 3
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcOccluded1(scene, &context, &ray);
#else
    rtcOccluded1(scene, &ray, nullptr);
#endif
    return ray.tfar < 0.0f;
  }
};

RayCaster::RayCaster(std::span<const Surface> surfaces)
    : surfaces_(surfaces), embree_(std::make_unique<Embree>()) {
  // One thread: the tree, and with it which of two equally near surfaces is met, is always the
  // same.
  embree_->device = rtcNewDevice("threads=1,set_affinity=0");
  HOLBA_CHECK(embree_->device != nullptr);
  embree_->scene = rtcNewScene(embree_->device);
  // Rays through the seam of two rectangles meet one of them.
  rtcSetSceneFlags(embree_->scene, RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(embree_->scene, RTC_BUILD_QUALITY_HIGH);
  embree_->curved.surfaces = surfaces;
  for (size_t i = 0; i < surfaces.size(); ++i) {
    (surfaces[i].shape == Shape::kRectangle ? embree_->flat_idxs : embree_->curved.idxs)
        .push_back(static_cast<int>(i));
  }
  const std::vector<int>& flat = embree_->flat_idxs;
  if (!flat.empty()) {
    RTCGeometry geometry = rtcNewGeometry(embree_->device, RTC_GEOMETRY_TYPE_QUAD);
    auto* vertices = static_cast<float*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                3 * sizeof(float), 4 * flat.size()));
    auto* indices = static_cast<unsigned*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT4, 4 * sizeof(unsigned), flat.size()));
    for (size_t i = 0; i < flat.size(); ++i) {
      const SurfaceMesh mesh = Tessellate(surfaces[static_cast<size_t>(flat[i])], 1.0);
      for (size_t k = 0; k < 4; ++k) {
        for (size_t axis = 0; axis < 3; ++axis) {
          vertices[3 * (4 * i + k) + axis] =
              static_cast<float>(mesh.vertices[k][static_cast<int>(axis)]);
        }
        indices[4 * i + k] = static_cast<unsigned>(4 * i + k);
      }
    }
    rtcCommitGeometry(geometry);
    embree_->flat_id = rtcAttachGeometry(embree_->scene, geometry);
    rtcReleaseGeometry(geometry);
  }
  if (!embree_->curved.idxs.empty()) {
    RTCGeometry geometry = rtcNewGeometry(embree_->device, RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryUserPrimitiveCount(geometry, static_cast<unsigned>(embree_->curved.idxs.size()));
    rtcSetGeometryUserData(geometry, &embree_->curved);
    rtcSetGeometryBoundsFunction(geometry, CurvedBounds, nullptr);
    rtcSetGeometryIntersectFunction(geometry, CurvedIntersect);
    rtcSetGeometryOccludedFunction(geometry, CurvedOccluded);
    rtcCommitGeometry(geometry);
    embree_->curved_id = rtcAttachGeometry(embree_->scene, geometry);
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(embree_->scene);
  HOLBA_CHECK(rtcGetDeviceError(embree_->device) == RTC_ERROR_NONE);
}

RayCaster::~RayCaster() = default;

std::optional<RayCaster::Hit> RayCaster::Cast(const Vector3d& from, const Vector3d& ray,
                                              double near) const {
  RTCRayHit ray_hit{};
  ray_hit.ray = MakeRay(from, ray, near, std::numeric_limits<double>::infinity());
  ray_hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
#if HOLBA_EMBREE_MAJOR == 3
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(embree_->scene, &context, &ray_hit);
#else
  rtcIntersect1(embree_->scene, &ray_hit, nullptr);
#endif
  if (ray_hit.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  Hit hit;
  const std::vector<int>& idxs =
      ray_hit.hit.geomID == embree_->flat_id ? embree_->flat_idxs : embree_->curved.idxs;
  hit.surface = idxs[ray_hit.hit.primID];
  const Surface& surface = surfaces_[static_cast<size_t>(hit.surface)];
  const auto found = static_cast<double>(ray_hit.ray.tfar);
  if (surface.shape == Shape::kRectangle || surface.shape == Shape::kDisc) {
    // Of the plane: at the rim the floats may have gone a little beyond.
    const Vector3d normal = surface.axes.col(2);
    hit.distance = normal.dot(surface.origin - from) / normal.dot(ray);
  } else {
    const double play = 1e-4 * (1.0 + found);
    hit.distance = Intersect(surface, from, ray, found - play, found + play).value_or(found);
  }
  hit.point = from + hit.distance * ray;
  hit.normal = NormalAt(surface, hit.point);
  hit.from_outside = hit.normal.dot(ray) < 0.0;
  return hit;
}

bool RayCaster::IsBlocked(const Vector3d& from, const Vector3d& to) const {
  const Vector3d way = to - from;
  const double distance = way.norm();
  if (!(distance > 2.0 * kNear)) return false;
  return embree_->Occluded(MakeRay(from, way / distance, kNear, distance - kNear));
}

bool RayCaster::IsCovered(const Vector3d& from, const Vector3d& ray) const {
  return embree_->Occluded(MakeRay(from, ray, kNear, std::numeric_limits<double>::infinity()));
}

}  // namespace holba
