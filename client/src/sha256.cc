#include "client/src/sha256.h"

#include <openssl/evp.h>

#include <stdexcept>

namespace planish {

std::string Sha256(const std::string& bytes) {
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned int length = 0;
  if (EVP_Digest(bytes.data(), bytes.size(), digest, &length, EVP_sha256(), nullptr) != 1) {
    throw std::runtime_error("OpenSSL has no SHA-256");
  }
  return std::string(digest, digest + length);
}

}  // namespace planish
