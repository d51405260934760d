// Which of several servers behind one address a call is for.
#pragma once

#include <string>
#include <string_view>

namespace planish {
inline namespace api {

// Metadata of every call about a job or an upload of a server that has a name of its own (planishd --instance): a proxy
// sends the call to that server by it (deploy/proxy).
inline constexpr char kRouteKey[] = "planish-route";

// The server's name in "jobs/NAME.ID" and "uploads/NAME.ID"; empty if there is none ("jobs/ID"), or if it is not one
// that a server can have: [a-z0-9-], at most 63 characters.
std::string RouteOf(std::string_view resource);

}  // namespace api
}  // namespace planish
