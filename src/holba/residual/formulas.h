// SPDX-License-Identifier: BSD-3-Clause
// Formulas of the residuals as templates on the scalar: T is double, or a pack (simd/pack.h).
// Vectors are arrays of 3, matrices row-major. Derivatives go backwards: from the row d(r)/d(what
// the camera makes of a feature) to the rows by the feature, the pose and the group, so that no
// matrix larger than 3 x 3 appears.
#pragma once

#include "holba/simd/lanes.h"

namespace holba {

template <typename T>
HOLBA_SIMD_INLINE T Dot(const T* a, const T* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

template <typename T>
HOLBA_SIMD_INLINE void Cross(const T* a, const T* b, T* out) {
  out[0] = a[1] * b[2] - a[2] * b[1];
  out[1] = a[2] * b[0] - a[0] * b[2];
  out[2] = a[0] * b[1] - a[1] * b[0];
}

template <typename T>
HOLBA_SIMD_INLINE void AddCross(const T* a, const T* b, T* sum) {
  sum[0] += a[1] * b[2] - a[2] * b[1];
  sum[1] += a[2] * b[0] - a[0] * b[2];
  sum[2] += a[0] * b[1] - a[1] * b[0];
}

// M v.
template <typename T>
HOLBA_SIMD_INLINE void Times(const T* m, const T* v, T* out) {
  for (int i = 0; i < 3; ++i) out[i] = Dot(m + 3 * i, v);
}

// v M.
template <typename T>
HOLBA_SIMD_INLINE void RowTimes(const T* v, const T* m, T* out) {
  for (int i = 0; i < 3; ++i) out[i] = v[0] * m[i] + v[1] * m[3 + i] + v[2] * m[6 + i];
}

// The two columns of TangentBasis (geometry/manifold.h).
template <typename T>
HOLBA_SIMD_INLINE void TangentBasisColumns(const T* v, T* first, T* second) {
  const T sign = Lanes<T>::SignOf(v[2]);
  const T a = -1.0 / (sign + v[2]);
  const T b = v[0] * v[1] * a;
  first[0] = 1.0 + sign * v[0] * v[0] * a;
  first[1] = sign * b;
  first[2] = -sign * v[0];
  second[0] = b;
  second[1] = sign + v[1] * v[1] * a;
  second[2] = -v[1];
}

// x_cam = R x + t of a pose [qx qy qz qw tx ty tz], then, where the image is not of the rig's
// reference sensor, x_sensor = Rs x_cam + ts. kSensor: with that second step.
template <typename T, bool kSensor>
struct ViewFormulas {
  T R[9], t[3];
  T Rs[9], ts[3];

  HOLBA_SIMD_INLINE void SetPose(const T* pose) {
    const T x2 = pose[0] + pose[0], y2 = pose[1] + pose[1], z2 = pose[2] + pose[2];
    const T xx = x2 * pose[0], yy = y2 * pose[1], zz = z2 * pose[2];
    const T xy = x2 * pose[1], xz = x2 * pose[2], yz = y2 * pose[2];
    const T wx = x2 * pose[3], wy = y2 * pose[3], wz = z2 * pose[3];
    R[0] = 1.0 - (yy + zz);
    R[1] = xy - wz;
    R[2] = xz + wy;
    R[3] = xy + wz;
    R[4] = 1.0 - (xx + zz);
    R[5] = yz - wx;
    R[6] = xz - wy;
    R[7] = yz + wx;
    R[8] = 1.0 - (xx + yy);
    for (int i = 0; i < 3; ++i) t[i] = pose[4 + i];
  }

  // rotation is column-major, as SensorPose has it.
  HOLBA_SIMD_INLINE void SetSensor(const T* rotation, const T* translation) {
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) Rs[3 * r + c] = rotation[3 * c + r];
      ts[r] = translation[r];
    }
  }

  // A world point X: rotated = R X, in_cam its place in the camera.
  HOLBA_SIMD_INLINE void SeePoint(const T* X, T* rotated, T* in_cam) const {
    Times(R, X, rotated);
    if constexpr (kSensor) {
      const T in_rig[3] = {rotated[0] + t[0], rotated[1] + t[1], rotated[2] + t[2]};
      Times(Rs, in_rig, in_cam);
      for (int i = 0; i < 3; ++i) in_cam[i] += ts[i];
    } else {
      for (int i = 0; i < 3; ++i) in_cam[i] = rotated[i] + t[i];
    }
  }

  // From the row by in_cam: by the point (3) and by the pose's tangent (6).
  HOLBA_SIMD_INLINE void PullPoint(const T* by_cam, const T* rotated, T* by_point,
                                   T* by_pose) const {
    T row[3] = {by_cam[0], by_cam[1], by_cam[2]};
    if constexpr (kSensor) RowTimes(by_cam, Rs, row);
    RowTimes(row, R, by_point);
    Cross(rotated, row, by_pose);
    for (int i = 0; i < 3; ++i) by_pose[3 + i] = row[i];
  }

  // What is kept of a world line (d, m) on the way to its moment in the camera.
  struct LineOnTheWay {
    T d[3], m[3];  // R d, R m
  };

  HOLBA_SIMD_INLINE void SeeLine(const T* d, const T* m, LineOnTheWay* way,
                                 T* moment_in_cam) const {
    Times(R, d, way->d);
    Times(R, m, way->m);
    T in_rig[3] = {way->m[0], way->m[1], way->m[2]};
    AddCross(t, way->d, in_rig);
    if constexpr (kSensor) {
      T d_in_cam[3];
      Times(Rs, way->d, d_in_cam);
      Times(Rs, in_rig, moment_in_cam);
      AddCross(ts, d_in_cam, moment_in_cam);
    } else {
      for (int i = 0; i < 3; ++i) moment_in_cam[i] = in_rig[i];
    }
  }

  // From the row by the moment in the camera: by (d, m) of the line and by the pose's tangent.
  HOLBA_SIMD_INLINE void PullLine(const T* by_moment, const LineOnTheWay& way, T* by_d, T* by_m,
                                  T* by_pose) const {
    T h[3] = {by_moment[0], by_moment[1], by_moment[2]};
    T e[3];  // by R d
    if constexpr (kSensor) {
      T across[3], by_direction[3];
      Cross(by_moment, ts, across);
      RowTimes(across, Rs, by_direction);
      RowTimes(by_moment, Rs, h);
      Cross(h, t, e);
      for (int i = 0; i < 3; ++i) e[i] += by_direction[i];
    } else {
      Cross(h, t, e);
    }
    RowTimes(e, R, by_d);
    RowTimes(h, R, by_m);
    Cross(way.m, h, by_pose);
    AddCross(way.d, e, by_pose);
    Cross(way.d, h, by_pose + 3);
  }
};

// The pixel of a world point, by `camera.Project(in_cam, pixel, d_point, d_params)`, and its
// derivatives: by the point (2 x 3) and the pose (2 x 6), both or none (null), and by the
// parameters (null: not wanted).
template <typename T, bool kSensor, typename Camera>
HOLBA_SIMD_INLINE MaskOf<T> SeePixel(const Camera& camera, const ViewFormulas<T, kSensor>& view,
                                     const T* X, T* pixel, T* by_point, T* by_pose, T* by_params) {
  T rotated[3], in_cam[3], d_cam[6] = {};
  view.SeePoint(X, rotated, in_cam);
  const MaskOf<T> seen =
      camera.Project(in_cam, pixel, by_point != nullptr ? d_cam : nullptr, by_params);
  if (by_point == nullptr || IsSingleFalse<T>(seen)) return seen;
  for (int row = 0; row < 2; ++row) {
    view.PullPoint(d_cam + 3 * row, rotated, by_point + 3 * row, by_pose + 6 * row);
  }
  return seen;
}

// A line block [d p] as (d, m), m = p x d, with the basis of its tangent.
template <typename T>
struct LineFormulas {
  T d[3], p[3], m[3];
  T first[3] = {}, second[3] = {};

  HOLBA_SIMD_INLINE void Set(const T* block) {
    for (int i = 0; i < 3; ++i) {
      d[i] = block[i];
      p[i] = block[3 + i];
    }
    Cross(p, d, m);
  }
  HOLBA_SIMD_INLINE void SetBasis() { TangentBasisColumns(d, first, second); }

  // From the rows by d and m: by the tangent of LineManifold (4).
  HOLBA_SIMD_INLINE void Pull(const T* by_d, const T* by_m, T* by_tangent) const {
    T by_direction[3] = {by_d[0], by_d[1], by_d[2]}, by_anchor[3];
    AddCross(by_m, p, by_direction);
    Cross(d, by_m, by_anchor);
    by_tangent[0] = Dot(by_direction, first);
    by_tangent[1] = Dot(by_direction, second);
    by_tangent[2] = Dot(by_anchor, first);
    by_tangent[3] = Dot(by_anchor, second);
  }
};

// K = [fx 0 cx; 0 fy cy; 0 0 1] of ideal pixels.
template <typename T>
struct CalibrationFormulas {
  T fx, fy, cx, cy;

  // Image l = K_l m of a line with moment m in the camera: l . (x, y, 1) = 0.
  HOLBA_SIMD_INLINE void SeeMoment(const T* m, T* l) const {
    l[0] = fy * m[0];
    l[1] = fx * m[1];
    l[2] = -fy * cx * m[0] - fx * cy * m[1] + fx * fy * m[2];
  }
  // From the row by l: by m and by (fx, fy, cx, cy).
  HOLBA_SIMD_INLINE void PullMoment(const T* by_l, const T* m, T* by_moment,
                                    T* by_calibration) const {
    by_moment[0] = fy * (by_l[0] - cx * by_l[2]);
    by_moment[1] = fx * (by_l[1] - cy * by_l[2]);
    by_moment[2] = fx * fy * by_l[2];
    by_calibration[0] = by_l[1] * m[1] + by_l[2] * (fy * m[2] - cy * m[1]);
    by_calibration[1] = by_l[0] * m[0] + by_l[2] * (fx * m[2] - cx * m[0]);
    by_calibration[2] = -by_l[2] * fy * m[0];
    by_calibration[3] = -by_l[2] * fx * m[1];
  }
};

// The image l of a world line (d, m) and, backwards, from a row by l to those by the line, the pose
// and (fx, fy, cx, cy).
template <typename T, bool kSensor>
struct LineInView {
  typename ViewFormulas<T, kSensor>::LineOnTheWay way;
  T moment[3], l[3];

  HOLBA_SIMD_INLINE void Set(const CalibrationFormulas<T>& k, const ViewFormulas<T, kSensor>& view,
                             const T* d, const T* m) {
    view.SeeLine(d, m, &way, moment);
    k.SeeMoment(moment, l);
  }
  HOLBA_SIMD_INLINE void Pull(const CalibrationFormulas<T>& k, const ViewFormulas<T, kSensor>& view,
                              const T* by_l, T* by_d, T* by_m, T* by_pose,
                              T* by_calibration) const {
    T by_moment[3];
    k.PullMoment(by_l, moment, by_moment, by_calibration);
    view.PullLine(by_moment, way, by_d, by_m, by_pose);
  }
};

// Depths below this share of the distance to the camera count as behind it: the pixel would be at
// the horizon (less than 6e-5 degrees from 90 degrees off the axis).
inline constexpr double kMinRelativeDepth = 1e-6;

// Signed distance of the ideal pixel of a world point from the line through two points of the
// image, and its rows.
template <typename T, bool kSensor>
struct DistanceFromSegment {
  T value;
  T by_point[3], by_pose[6];
  T by_calibration[4];  // fx fy cx cy
  T by_start[2], by_end[2];

  // False: the point is behind the camera, or the segment has no length.
  HOLBA_SIMD_INLINE MaskOf<T> Set(const CalibrationFormulas<T>& k,
                                  const ViewFormulas<T, kSensor>& view, const T* X, const T* start,
                                  const T* end, bool with_rows) {
    T rotated[3], x[3];
    view.SeePoint(X, rotated, x);
    const T along[2] = {end[0] - start[0], end[1] - start[1]};
    const T squared_length = along[0] * along[0] + along[1] * along[1];
    const T depth = x[2];
    // depth > kMinRelativeDepth |x|, without the root.
    const MaskOf<T> present = (squared_length > 0.0) & (depth > 0.0) &
                              (depth * depth > kMinRelativeDepth * kMinRelativeDepth * Dot(x, x));
    if (IsSingleFalse<T>(present)) return present;
    const T inverse_length = 1.0 / Lanes<T>::Sqrt(squared_length);
    const T inverse_depth = 1.0 / depth;
    const T u = x[0] * inverse_depth, v = x[1] * inverse_depth;
    const T normal[2] = {-along[1] * inverse_length, along[0] * inverse_length};
    const T from_start[2] = {k.fx * u + k.cx - start[0], k.fy * v + k.cy - start[1]};
    value = normal[0] * from_start[0] + normal[1] * from_start[1];
    if (!with_rows) return present;
    const T gx = normal[0] * k.fx * inverse_depth, gy = normal[1] * k.fy * inverse_depth;
    const T by_cam[3] = {gx, gy, -(gx * u + gy * v)};
    view.PullPoint(by_cam, rotated, by_point, by_pose);
    by_calibration[0] = normal[0] * u;
    by_calibration[1] = normal[1] * v;
    by_calibration[2] = normal[0];
    by_calibration[3] = normal[1];
    const T share = value * inverse_length * inverse_length;
    by_end[0] = from_start[1] * inverse_length - share * along[0];
    by_end[1] = -from_start[0] * inverse_length - share * along[1];
    by_start[0] = -normal[0] - by_end[0];
    by_start[1] = -normal[1] - by_end[1];
    return present;
  }
};

// Whether the image l of a line has a direction.
template <typename T>
HOLBA_SIMD_INLINE MaskOf<T> HasDirectionInImage(const T* l) {
  const T q = l[0] * l[0] + l[1] * l[1];
  return q > 1e-24 * (q + l[2] * l[2]);
}

// Signed distance of a point x of the image from the line l, and its row by l.
template <typename T>
HOLBA_SIMD_INLINE void DistanceFromLine(const T* l, const T* x, T* distance, T* by_l) {
  const T inverse_norm = 1.0 / Lanes<T>::Sqrt(l[0] * l[0] + l[1] * l[1]);
  const T n[2] = {l[0] * inverse_norm, l[1] * inverse_norm};
  *distance = n[0] * x[0] + n[1] * x[1] + l[2] * inverse_norm;
  by_l[0] = (x[0] - *distance * n[0]) * inverse_norm;
  by_l[1] = (x[1] - *distance * n[1]) * inverse_norm;
  by_l[2] = inverse_norm;
}

// Perpendicular vector from a point x of the image to the line l: (l.x) / (l1^2 + l2^2) (l1, l2),
// and its two rows by l.
template <typename T>
struct PerpendicularFormulas {
  T value[2];
  T by_l[6];

  HOLBA_SIMD_INLINE void Set(const T* l, const T* x, bool with_rows) {
    const T inverse_q = 1.0 / (l[0] * l[0] + l[1] * l[1]);
    const T s = (l[0] * x[0] + l[1] * x[1] + l[2]) * inverse_q;
    value[0] = s * l[0];
    value[1] = s * l[1];
    if (!with_rows) return;
    const T u = l[0] * inverse_q, v = l[1] * inverse_q;
    const T across = 2.0 * s * u * l[1];
    by_l[0] = u * x[0] + s - 2.0 * s * u * l[0];
    by_l[1] = u * x[1] - across;
    by_l[2] = u;
    by_l[3] = v * x[0] - across;
    by_l[4] = v * x[1] + s - 2.0 * s * v * l[1];
    by_l[5] = v;
  }
};

// A plane [nx ny nz w] (group/plane.h).
template <typename T>
struct PlaneFormulas {
  static constexpr int kAmbient = 4, kTangent = 3;
  T n[3], w;
  T first[3], second[3];  // basis of the tangent of n

  HOLBA_SIMD_INLINE void Set(const T* g) {
    for (int i = 0; i < 3; ++i) n[i] = g[i];
    w = g[3];
  }
  HOLBA_SIMD_INLINE void SetBasis() { TangentBasisColumns(n, first, second); }

  HOLBA_SIMD_INLINE void ToTangent(const T* by_n, const T& by_w, T* by_tangent) const {
    by_tangent[0] = Dot(by_n, first);
    by_tangent[1] = Dot(by_n, second);
    by_tangent[2] = by_w;
  }

  // Nearest point, and what is kept for the way back.
  struct PointOnTheWay {
    T X[3], distance;
  };
  HOLBA_SIMD_INLINE MaskOf<T> ProjectPoint(const T* X, T* on_plane, PointOnTheWay* way) const {
    way->distance = Dot(n, X) + w;
    for (int i = 0; i < 3; ++i) {
      way->X[i] = X[i];
      on_plane[i] = X[i] - way->distance * n[i];
    }
    return AllTrue<T>();
  }
  HOLBA_SIMD_INLINE void PullPoint(const T* by_projected, const PointOnTheWay& way, T* by_point,
                                   T* by_tangent) const {
    const T along = -Dot(n, by_projected);
    T by_n[3];
    for (int i = 0; i < 3; ++i) {
      by_point[i] = by_projected[i] + along * n[i];
      by_n[i] = along * way.X[i] - way.distance * by_projected[i];
    }
    ToTangent(by_n, along, by_tangent);
  }

  // Orthogonal projection of a line (d, m); undefined within min_sine of the normal.
  struct LineOnTheWay {
    T d[3], m[3];
    T a, gamma, lift, scale, inverse_squared_sine;
    T u[3], flat[3], moment[3];
  };
  HOLBA_SIMD_INLINE MaskOf<T> ProjectLine(const T* d, const T* m, double min_sine, T* on_d, T* on_m,
                                          LineOnTheWay* way) const {
    LineOnTheWay& k = *way;
    k.a = Dot(d, n);
    k.gamma = Dot(m, n);
    for (int i = 0; i < 3; ++i) {
      k.d[i] = d[i];
      k.m[i] = m[i];
      k.flat[i] = d[i] - k.a * n[i];
    }
    const T squared_sine = Dot(k.flat, k.flat);
    Cross(d, n, k.u);
    k.lift = w - Dot(k.u, m);
    k.inverse_squared_sine = 1.0 / squared_sine;
    k.scale = Lanes<T>::Sqrt(k.inverse_squared_sine);
    const T by_m = 1.0 - k.a * k.a, by_d = k.a * k.gamma;
    for (int i = 0; i < 3; ++i) {
      k.moment[i] = by_m * m[i] + by_d * d[i] + k.lift * k.u[i];
      on_d[i] = k.scale * k.flat[i];
      on_m[i] = k.scale * k.moment[i];
    }
    return squared_sine >= min_sine * min_sine;
  }
  HOLBA_SIMD_INLINE void PullLine(const T* by_on_d, const T* by_on_m, const LineOnTheWay& k,
                                  T* by_d, T* by_m, T* by_tangent) const {
    // Through the scaling.
    const T shrink = (Dot(by_on_d, k.flat) + Dot(by_on_m, k.moment)) * k.inverse_squared_sine;
    T by_flat[3], by_moment[3];
    for (int i = 0; i < 3; ++i) {
      by_flat[i] = k.scale * (by_on_d[i] - shrink * k.flat[i]);
      by_moment[i] = k.scale * by_on_m[i];
    }
    // Through moment = (1 - a^2) m + a gamma d + lift u.
    const T on_d = Dot(by_moment, k.d), by_lift = Dot(by_moment, k.u);
    const T by_gamma = k.a * on_d;
    const T by_a = k.gamma * on_d - 2.0 * k.a * Dot(by_moment, k.m) - Dot(n, by_flat);
    T by_u[3], by_n[3];
    for (int i = 0; i < 3; ++i) {
      by_m[i] = (1.0 - k.a * k.a) * by_moment[i] + by_gamma * n[i] - by_lift * k.u[i];
      by_d[i] = k.a * k.gamma * by_moment[i] + by_flat[i] + by_a * n[i];
      by_u[i] = k.lift * by_moment[i] - by_lift * k.m[i];
      by_n[i] = by_gamma * k.m[i] - k.a * by_flat[i] + by_a * k.d[i];
    }
    AddCross(n, by_u, by_d);
    AddCross(by_u, k.d, by_n);
    ToTangent(by_n, by_lift, by_tangent);
  }
};

}  // namespace holba
