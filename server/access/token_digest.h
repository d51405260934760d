// SHA-256 of bearer tokens. A server knows only these digests, not the tokens.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace planish {

using TokenDigest = std::array<std::uint8_t, 32>;

TokenDigest DigestOf(std::string_view token);

// Whether the digests are equal. Takes the same time wherever they differ, so that timing reveals nothing.
bool IsEqual(const TokenDigest& a, const TokenDigest& b);

// Parses 64 hexadecimal digits, upper or lower case. Returns nullopt for any other text.
std::optional<TokenDigest> ParseTokenDigest(std::string_view hex);

// The first 8 hexadecimal digits: a name for a token that has none. They reveal nothing about a random token.
std::string ShortName(const TokenDigest& digest);

}  // namespace planish
