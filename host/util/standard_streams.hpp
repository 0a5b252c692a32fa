// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace raysplats {

/// Opens /dev/null in place of the standard streams that whoever started the program has closed:
/// files opened later would get their numbers, and with them what is printed.
void open_standard_streams();

/// Writes out what has been printed to standard output. Throws DataError with the system's reason
/// when any of it could not be written.
void finish_standard_output();

}  // namespace raysplats
