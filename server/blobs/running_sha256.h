#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "openssl/evp.h"

namespace planish {

// SHA-256 of bytes that arrive in pieces. A copy continues independently. Throws std::bad_alloc if the crypto library
// has no memory.
class RunningSha256 {
 public:
  RunningSha256();
  RunningSha256(const RunningSha256& other);
  RunningSha256& operator=(const RunningSha256& other);

  void Update(std::string_view bytes);

  // The 32 bytes of the digest so far.
  std::string Digest() const;

 private:
  struct Free {
    void operator()(EVP_MD_CTX* context) const { EVP_MD_CTX_free(context); }
  };
  std::unique_ptr<EVP_MD_CTX, Free> context_;
};

}  // namespace planish
