import sys, time, numpy as np, pycolmap

model, truth = (pycolmap.Reconstruction(path) for path in sys.argv[1:3])
begin = time.process_time()
config = pycolmap.BundleAdjustmentConfig()
for image_id in model.reg_image_ids():
    config.add_image(image_id)
for camera_id in model.cameras:
    config.set_constant_cam_intrinsics(camera_id)
config.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
pycolmap.create_default_bundle_adjuster(pycolmap.BundleAdjustmentOptions(), config, model).solve()
seconds = time.process_time() - begin

poses = {image.name: image.cam_from_world() for image in model.images.values()}
true = {image.name: image.cam_from_world() for image in truth.images.values()}
errors = []
for a, b in ((a, b) for a in true for b in true if a < b):
    found, right = poses[b] * poses[a].inverse(), true[b] * true[a].inverse()
    turn = (found.rotation * right.rotation.inverse()).angle()
    t, u = found.translation, right.translation
    errors.append(np.rad2deg(max(turn, np.arctan2(np.linalg.norm(np.cross(t, u)), t @ u))))
print(f"{seconds:.2f} s, AUC", *(f"@{m:g}: {100 * np.mean(np.maximum(0, 1 - np.array(errors) / m)):.1f}" for m in (0.5, 1, 3)))
