#include "server/blobs/running_sha256.h"

#include <new>

namespace planish {
namespace {

void Check(int success) {
  if (success != 1) throw std::bad_alloc();
}

}  // namespace

RunningSha256::RunningSha256() : context_(EVP_MD_CTX_new()) {
  Check(context_ != nullptr);
  Check(EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr));
}

RunningSha256::RunningSha256(const RunningSha256& other) : context_(EVP_MD_CTX_new()) {
  Check(context_ != nullptr);
  *this = other;
}

RunningSha256& RunningSha256::operator=(const RunningSha256& other) {
  Check(EVP_MD_CTX_copy_ex(context_.get(), other.context_.get()));
  return *this;
}

void RunningSha256::Update(std::string_view bytes) {
  Check(EVP_DigestUpdate(context_.get(), bytes.data(), bytes.size()));
}

std::string RunningSha256::Digest() const {
  const RunningSha256 copy(*this);
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned int length = 0;
  Check(EVP_DigestFinal_ex(copy.context_.get(), digest, &length));
  return {digest, digest + length};
}

}  // namespace planish
