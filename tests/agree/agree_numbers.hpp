#pragma once
#include <cstdio>
#include <string>

namespace dashpot::agree {

/// A line `KIND NAME NUMBER`; compare.py has a tolerance for each kind.
inline void print(const char* kind, const std::string& name, double number) {
  std::printf("%s %s %.17g\n", kind, name.c_str(), number);
}

template <class Vector>
void print_all(const char* kind, const std::string& name, const Vector& numbers) {
  for (int i = 0; i < numbers.size(); ++i) {
    print(kind, name + "[" + std::to_string(i) + "]", numbers[i]);
  }
}

}  // namespace dashpot::agree
