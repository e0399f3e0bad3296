// Errors as values. Below icd/ a function that may fail returns Result<T> (or Status, when there is no
// value); nothing is thrown across rooms. icd/ logs the message and chooses the VkResult.
//
//   Result<Module> parse(std::span<const uint32_t> words);
//   auto module = parse(words);
//   if (!module) return std::move(module).error();
//   use(*module);
#pragma once

#include <cassert>
#include <cstdarg>
#include <cstdio>
#include <string>
#include <utility>
#include <variant>

namespace pumice::base {

struct Error {
  std::string message;
};

// An Error with a printf-like message.
[[gnu::format(printf, 1, 2)]] inline Error errorf(const char* format, ...) {
  va_list args;
  va_start(args, format);
  va_list again;
  va_copy(again, args);
  int length = std::vsnprintf(nullptr, 0, format, args);
  va_end(args);
  Error error;
  if (length > 0) {
    error.message.resize(size_t(length));
    std::vsnprintf(error.message.data(), size_t(length) + 1, format, again);
  }
  va_end(again);
  return error;
}

template <typename T>
class [[nodiscard]] Result {
 public:
  Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}
  Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}

  bool hasValue() const { return state_.index() == 0; }
  explicit operator bool() const { return hasValue(); }

  // Only when hasValue().
  T& value() & { return *valuePointer(); }
  const T& value() const& { return *valuePointer(); }
  T&& value() && { return std::move(*valuePointer()); }
  T& operator*() & { return value(); }
  const T& operator*() const& { return value(); }
  T&& operator*() && { return std::move(*this).value(); }
  T* operator->() { return valuePointer(); }
  const T* operator->() const { return valuePointer(); }

  T valueOr(T fallback) const& { return hasValue() ? value() : std::move(fallback); }
  T valueOr(T fallback) && { return hasValue() ? std::move(*this).value() : std::move(fallback); }

  // Only when !hasValue().
  const Error& error() const& { return *errorPointer(); }
  Error&& error() && { return std::move(*const_cast<Error*>(errorPointer())); }

 private:
  T* valuePointer() {
    assert(hasValue());
    return std::get_if<0>(&state_);
  }
  const T* valuePointer() const {
    assert(hasValue());
    return std::get_if<0>(&state_);
  }
  const Error* errorPointer() const {
    assert(!hasValue());
    return std::get_if<1>(&state_);
  }

  std::variant<T, Error> state_;
};

// Success or an Error. A default-made one is success.
template <>
class [[nodiscard]] Result<void> {
 public:
  Result() = default;
  Result(Error error) : failed_(true), error_(std::move(error)) {}

  bool hasValue() const { return !failed_; }
  explicit operator bool() const { return !failed_; }

  const Error& error() const& {
    assert(failed_);
    return error_;
  }
  Error&& error() && {
    assert(failed_);
    return std::move(error_);
  }

 private:
  bool failed_ = false;
  Error error_;
};

using Status = Result<void>;

// Leaves the calling function with the error of a Status or Result, if it has one.
#define PUMICE_TRY(expression)                                   \
  do {                                                           \
    auto pumiceStatus_ = (expression);                           \
    if (!pumiceStatus_) return std::move(pumiceStatus_).error(); \
  } while (false)

}  // namespace pumice::base
