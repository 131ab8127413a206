// SPDX-License-Identifier: BSD-3-Clause
#include "holba/group/group_type.h"

namespace holba {

const GroupType* FindGroupType(int code) {
  for (const GroupType* type : AllGroupTypes()) {
    if (type->code == code) return type;
  }
  return nullptr;
}

const GroupType* FindGroupType(std::string_view name) {
  for (const GroupType* type : AllGroupTypes()) {
    if (type->name == name) return type;
  }
  return nullptr;
}

}  // namespace holba
