#pragma once

#include <functional>
#include <string>
#include <string_view>

namespace planish {

// 16 random hexadecimal digits from the system's entropy. Thread-safe.
std::string RandomId();

// Whether a server may be called so: [a-z0-9-], 1 to 63 characters. A dot in an id thus ends such a name.
bool IsInstanceName(std::string_view name);

// Makes ids "INSTANCE.ID", so that a proxy can tell from the name of a job or an upload whose it is; plain ids where
// `instance` is empty. Thread-safe.
std::function<std::string()> IdsOf(std::string instance);

}  // namespace planish
