// SPDX-License-Identifier: BSD-3-Clause
// Failed calls of PETSc become exceptions.
#pragma once

#include <petscsys.h>

#include <string>

#include "holba/base/check.h"

namespace holba {

inline void CheckPetsc(PetscErrorCode code, const char* call) {
  if (code == 0) return;
  const char* text = nullptr;
  char* specific = nullptr;
  PetscErrorMessage(code, &text, &specific);
  throw CheckError(std::string(call) + ": " + (text ? text : "") + " " +
                   (specific ? specific : ""));
}

}  // namespace holba

#define HOLBA_CHECK_PETSC(call) ::holba::CheckPetsc((call), #call)
