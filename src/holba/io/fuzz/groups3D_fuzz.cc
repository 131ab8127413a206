// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/fuzz/fuzz_reader.h"

HOLBA_FUZZ_READER("groups3D")
