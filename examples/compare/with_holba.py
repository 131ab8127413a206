import sys, time, holba

model, truth = holba.read_model(sys.argv[1]), holba.read_poses(sys.argv[2])
begin = time.process_time()
holba.adjust(model, refine_focal_length=False, refine_extra_params=False)
seconds = time.process_time() - begin

auc = holba.compare_poses(model, truth).auc([0.5, 1, 3])
print(f"{seconds:.2f} s, AUC", *(f"@{m:g}: {a:.1f}" for m, a in zip((0.5, 1, 3), auc)))
