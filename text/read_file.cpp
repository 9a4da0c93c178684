#include <dashpot/text/read_file.hpp>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace dashpot::text {
namespace {

[[noreturn]] void refuse(const std::string& reason) {
  throw std::runtime_error("cannot be read: " + reason);
}

/// An open file, closed with it.
class Descriptor {
 public:
  // O_NONBLOCK: a pipe without a writer is opened at once, and then refused.
  explicit Descriptor(const std::string& path)
      : number_(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY)) {
    if (number_ < 0) refuse(std::strerror(errno));
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() { ::close(number_); }

  int number() const noexcept { return number_; }

 private:
  int number_;
};

}  // namespace

std::string read_file(const std::string& path, std::size_t most) {
  const Descriptor file(path);
  struct stat status {};
  if (::fstat(file.number(), &status) != 0) refuse(std::strerror(errno));
  if (S_ISDIR(status.st_mode)) refuse(std::strerror(EISDIR));
  if (!S_ISREG(status.st_mode)) refuse("not a regular file");
  std::string text;
  constexpr std::size_t kPart = 1u << 16;
  while (true) {  // files of /proc do not know their size
    const std::size_t size = text.size();
    text.resize(size + kPart);
    const ssize_t got = ::read(file.number(), text.data() + size, kPart);
    text.resize(size + static_cast<std::size_t>(std::max<ssize_t>(got, 0)));
    if (got < 0 && errno != EINTR) refuse(std::strerror(errno));
    if (text.size() > most) refuse("larger than " + std::to_string(most >> 20) + " MiB");
    if (got == 0) return text;
  }
}

}  // namespace dashpot::text
