// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace raysplats {

/// A text in single quotes, as shells read it.
std::string shell_quoted(std::string_view text);

/// A word of a command that can be pasted into a shell: in quotes only where it needs them.
std::string shell_word(std::string_view text);

}  // namespace raysplats
