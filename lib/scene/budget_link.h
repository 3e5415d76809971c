// The budget of a scene's slopes (budget/scene_budget.h), as far as the scene needs it.
#pragma once

#include <memory>

#include "scene/shared_with.h"

namespace fs {

// Both are called with the scene's lock held.
class BudgetLink {
 public:
  // The scene allows itself another stiffness: what is set from now on begins within it.
  virtual void take_max_stiffness() = 0;
  virtual const std::shared_ptr<const Sharing>& sharing() const noexcept = 0;  // null: nobody shares

 protected:
  ~BudgetLink() = default;
};

}  // namespace fs
