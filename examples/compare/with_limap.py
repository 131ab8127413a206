import sys, time, numpy as np, pycolmap, limap

adjustment = limap._limap._estimators._bundle_adjustment
model, truth = limap._limap._scene.HolisticReconstruction(), pycolmap.Reconstruction(sys.argv[2])
model.read(sys.argv[1])
begin = time.process_time()
config = adjustment.StructureBundleAdjustmentConfig()
for image_id in model.point_recon.reg_image_ids():
    config.add_image(image_id)
for camera_id in model.point_recon.cameras:
    config.set_constant_cam_intrinsics(camera_id)
for line_id in model.structure_recon.lines3D:
    config.add_variable_line(line_id)
for group_id in model.structure_recon.groups3D:
    config.add_variable_group(group_id)
config.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
adjustment.create_structure_bundle_adjuster(adjustment.StructureBundleAdjustmentOptions(), config, model).solve()
seconds = time.process_time() - begin

poses = {image.name: image.cam_from_world() for image in model.point_recon.images.values()}
true = {image.name: image.cam_from_world() for image in truth.images.values()}
errors = []
for a, b in ((a, b) for a in true for b in true if a < b):
    found, right = poses[b] * poses[a].inverse(), true[b] * true[a].inverse()
    turn = (found.rotation * right.rotation.inverse()).angle()
    t, u = found.translation, right.translation
    errors.append(np.rad2deg(max(turn, np.arctan2(np.linalg.norm(np.cross(t, u)), t @ u))))
print(f"{seconds:.2f} s, AUC", *(f"@{m:g}: {100 * np.mean(np.maximum(0, 1 - np.array(errors) / m)):.1f}" for m in (0.5, 1, 3)))
