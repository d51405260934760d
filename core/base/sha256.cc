#include "core/base/sha256.h"

#include <openssl/evp.h>

#include <new>

namespace planish {

std::string Sha256(std::string_view bytes) {
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned int length = 0;
  if (EVP_Digest(bytes.data(), bytes.size(), digest, &length, EVP_sha256(), nullptr) != 1) throw std::bad_alloc();
  return {digest, digest + length};
}

}  // namespace planish
