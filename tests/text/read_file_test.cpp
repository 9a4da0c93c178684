// Which files are read, and what is said of others.
#include <dashpot/tests/support/scratch.hpp>
#include <dashpot/text/read_file.hpp>

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <stdexcept>
#include <string>

namespace dashpot::text {
namespace {

std::string refusal(const std::string& path, std::size_t most = 1u << 20) {
  try {
    read_file(path, most);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "read";
}

TEST(ReadFile, ReturnsEveryByte) {
  const tests::Scratch scratch;
  std::string text(200'000, 'x');
  text[100'000] = '\0';
  text[5] = '\n';
  EXPECT_EQ(read_file(scratch.write("a", text), text.size()), text);
  EXPECT_EQ(read_file(scratch.write("empty", ""), 1u << 20), "");
}

TEST(ReadFile, HasALimit) {
  const tests::Scratch scratch;
  EXPECT_EQ(refusal(scratch.write("a", std::string((1u << 20) + 1, 'x'))),
            "cannot be read: larger than 1 MiB");
  EXPECT_EQ(refusal(scratch.write("b", std::string(1u << 20, 'x'))), "read");
}

// A pipe without a writer would keep the caller waiting for ever, and /dev/zero never ends.
TEST(ReadFile, RefusesWhatIsNoFile) {
  const tests::Scratch scratch;
  const std::string pipe = scratch.path("pipe");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_EQ(refusal(pipe), "cannot be read: not a regular file");
  EXPECT_EQ(refusal("/dev/zero"), "cannot be read: not a regular file");
  EXPECT_EQ(refusal(scratch.path("")), "cannot be read: Is a directory");
  EXPECT_EQ(refusal(scratch.path("none")), "cannot be read: No such file or directory");
}

}  // namespace
}  // namespace dashpot::text
