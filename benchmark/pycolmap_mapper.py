#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""COLMAP 4's mappers on a database, for mapping_scale.py and mapping_sets.py, which start it with an interpreter that has
pycolmap (PyPI; 4.2). Writes the model with the most images to OUTPUT and prints one JSON line: user seconds of mapping
and of the refinement, numbers of images and models.

--known: intrinsics are held. --refine: the model is adjusted once more as a skilled user would do it, with Cauchy loss
of 1 px and points of three or more images, without --known with a free principal point.
"""

import argparse
import json
import pathlib
import resource
import tempfile

import pycolmap


def user_seconds() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_utime


def set_intrinsics(options, known: bool) -> None:
    options.refine_focal_length = options.refine_extra_params = not known
    options.refine_principal_point = False


def map_images(arguments, folder: str) -> dict:
    if arguments.mapper == "global":
        options = pycolmap.GlobalPipelineOptions()
        set_intrinsics(options.mapper.bundle_adjustment, arguments.known)
        options.mapper.bundle_adjustment.min_track_length = 3
        return pycolmap.global_mapping(arguments.database, arguments.images, folder, options)
    options = pycolmap.IncrementalPipelineOptions()
    options.ba_refine_focal_length = options.ba_refine_extra_params = not arguments.known
    return pycolmap.incremental_mapping(arguments.database, arguments.images, folder, options)


def refine(model, known: bool) -> None:
    options = pycolmap.BundleAdjustmentOptions()
    set_intrinsics(options, known)
    options.refine_principal_point = not known
    options.refine_sensor_from_rig = False
    options.min_track_length = 3
    options.print_summary = False
    options.ceres.loss_function_type = pycolmap.LossFunctionType.CAUCHY
    options.ceres.loss_function_scale = 1.0
    config = pycolmap.BundleAdjustmentConfig()
    for image_id in model.reg_image_ids():
        config.add_image(image_id)
    config.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
    pycolmap.create_default_bundle_adjuster(options, config, model).solve()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("database")
    parser.add_argument("output", type=pathlib.Path)
    parser.add_argument("--mapper", choices=["incremental", "global"], default="incremental")
    parser.add_argument("--images", default=".", help="folder of the photographs, for colours")
    parser.add_argument("--input", help="refine this model instead of mapping")
    parser.add_argument("--known", action="store_true")
    parser.add_argument("--refine", action="store_true")
    arguments = parser.parse_args()
    pycolmap.set_random_seed(0)
    pycolmap.logging.minloglevel = pycolmap.logging.ERROR.value
    begin = user_seconds()
    with tempfile.TemporaryDirectory() as folder:
        models = ({0: pycolmap.Reconstruction(arguments.input)} if arguments.input
                  else map_images(arguments, folder))
    mapped = user_seconds()
    result = {"version": pycolmap.__version__, "models": len(models), "images": 0, "map_seconds": mapped - begin,
              "refine_seconds": 0.0}
    if models:
        best = max(models.values(), key=lambda model: model.num_reg_images())
        if arguments.refine:
            refine(best, arguments.known)
            result["refine_seconds"] = user_seconds() - mapped
        arguments.output.mkdir(parents=True, exist_ok=True)
        best.write_binary(str(arguments.output))
        result["images"] = best.num_reg_images()
    print(json.dumps(result))


if __name__ == "__main__":
    main()
