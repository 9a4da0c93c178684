// `dashpot monitor --web` against hostile clients, and `dashpot export`. What a browser shows is
// tested in tests/web.
#include <dashpot/tests/apps/scene_run.hpp>
#include <dashpot/tests/threads/live_run.hpp>

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <atomic>
#include <fstream>
#include <limits>
#include <thread>

namespace dashpot::tests {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

/// A client that sends exactly the given bytes.
class Connection {
 public:
  explicit Connection(int port) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    void* any = &address;
    connected_ = ::connect(socket_, static_cast<sockaddr*>(any), sizeof address) == 0;
  }
  Connection(Connection&& other) noexcept
      : socket_(std::exchange(other.socket_, -1)), connected_(other.connected_) {}
  ~Connection() {
    if (socket_ >= 0) close(socket_);
  }
  bool connected() const { return connected_; }
  void say(const std::string& text) const {
    (void)::send(socket_, text.data(), text.size(), MSG_NOSIGNAL);
  }
  /// Returns what comes until the server ends, or `enough` is in it, or a hang is sure.
  std::string hear(const std::string& enough = "") const {
    std::string all;
    const auto end = Clock::now() + kHang;
    while (Clock::now() < end && (enough.empty() || all.find(enough) == std::string::npos)) {
      pollfd ready{socket_, POLLIN, 0};
      if (poll(&ready, 1, 100) <= 0) continue;
      std::array<char, 4096> part{};
      const ssize_t got = recv(socket_, part.data(), part.size(), 0);
      if (got <= 0) break;
      all.append(part.data(), static_cast<std::size_t>(got));
    }
    return all;
  }

 private:
  int socket_;
  bool connected_ = false;
};

/// A `dashpot monitor --web` at a port of its own.
class Site {
 public:
  explicit Site(std::vector<std::string> options)
      : monitor_([&options] {
          options.insert(options.begin(), {"monitor", "--web", "0"});
          return options;
        }()) {
    const auto end = Clock::now() + kHang;
    while (port == 0 && Clock::now() < end) {
      std::ifstream out(monitor_.out());
      std::string line;
      constexpr std::string_view kBegin = "http://127.0.0.1:";
      if (std::getline(out, line) && line.starts_with(kBegin) && !out.eof()) {
        port = std::stoi(line.substr(kBegin.size()));
      }
      if (port == 0) std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    EXPECT_NE(port, 0) << monitor_.complaints();
  }
  std::string ask(const std::string& first_line, const std::string& headers = "") const {
    const Connection client(port);
    client.say(first_line + "\r\nConnection: close\r\n" + headers + "\r\n");
    return client.hear();
  }
  std::string host() const { return "Host: 127.0.0.1:" + std::to_string(port) + "\r\n"; }
  /// A page that gets the stream.
  Connection open_stream() const {
    Connection page(port);
    page.say("GET /stream HTTP/1.1\r\n" + host() + "\r\n");
    return page;
  }
  std::string get(const std::string& path) const {
    return ask("GET " + path + " HTTP/1.1", host());
  }
  Running& monitor() { return monitor_; }

  int port = 0;

 private:
  Running monitor_;
};

Json body_of(const std::string& answer) {
  const auto begin = answer.find("\r\n\r\n");
  return Json::parse(begin == std::string::npos ? "" : answer.substr(begin + 4), nullptr, false);
}

/// A log of a second of a Panda.
std::string short_log(const Scratch& scratch) {
  std::string path = scratch.path("panda.lcm");
  const Outcome run =
      run_program({"run", scene("panda_release_c2"), "--fast", "--duration", "1", "--log", path});
  EXPECT_EQ(run.status, 0) << run.err;
  return path;
}

TEST(WebMonitor, TellsWallsAndTheAgeOfWhatItShows) {
  const Scratch scratch;
  const std::string log = scratch.path("table.lcm");
  const std::string table = scene("safety/table");
  ASSERT_EQ(run_program({"run", table, "--fast", "--duration", "1", "--log", log}).status, 0);
  const Site replay({"--log", log, "--config", table});
  const Json walls = body_of(replay.get("/setup"))["arm"]["walls"];
  ASSERT_EQ(walls.size(), 1U);
  EXPECT_EQ(walls[0]["stiffness"], 2e4);
  EXPECT_EQ(walls[0]["point"], Json({0, 0, 0.4559}));
  const Json frame = body_of(replay.get("/frame?t=0.7"));
  EXPECT_GE(frame["age"], 0);
  EXPECT_LT(frame["age"], 0.05);  // the log has a message more often
  EXPECT_THAT(replay.get("/safety.md"), AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("## Faults")));
  EXPECT_THAT(replay.get("/docs/safety.md"), StartsWith("HTTP/1.1 404"));
  const Site live({"--lcm-url", own_url()});
  const double age = body_of(live.get("/frame"))["age"];
  EXPECT_GE(age, 0);
  EXPECT_GT(body_of(live.get("/frame"))["age"], age);  // nothing comes
}

TEST(WebMonitor, AnswersGetsOfItsOwnPageAlone) {
  const Site site({"--lcm-url", own_url()});
  const std::string port = std::to_string(site.port);
  EXPECT_THAT(site.get("/"), AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("<!doctype html>"),
                                   HasSubstr("Content-Security-Policy: default-src 'none'")));
  EXPECT_THAT(site.ask("GET / HTTP/1.1", "Host: localhost:" + port + "\r\n"),
              StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(site.ask("GET / HTTP/1.1", site.host() + "Origin: http://127.0.0.1:" + port + "\r\n"),
              StartsWith("HTTP/1.1 200"));
  const std::string forbidden = "HTTP/1.1 403";
  for (const char* host : {"Host: evil.example\r\n", "Host: 127.0.0.1\r\n", "Host: \r\n",
                           "Host: 127.0.0.1.evil.example:80\r\n"}) {
    EXPECT_THAT(site.ask("GET / HTTP/1.1", host), StartsWith(forbidden)) << host;
  }
  EXPECT_THAT(site.ask("GET / HTTP/1.0"), StartsWith(forbidden));
  for (const std::string& origin : {std::string("null"), std::string("http://evil.example"),
                                    "https://127.0.0.1:" + port, "http://127.0.0.1:1" + port}) {
    for (const char* path : {"/", "/setup", "/stream"}) {
      EXPECT_THAT(site.ask(std::string("GET ") + path + " HTTP/1.1",
                           site.host() + "Origin: " + origin + "\r\n"),
                  StartsWith(forbidden))
          << origin;
    }
  }
  for (const char* method : {"POST", "PUT", "DELETE", "OPTIONS", "HEAD", "TRACE", "BREW"}) {
    EXPECT_THAT(site.ask(std::string(method) + " / HTTP/1.1", site.host()),
                StartsWith("HTTP/1.1 405"))
        << method;
  }
  EXPECT_THAT(site.ask("GET / HTTP/1.1", site.host() + "Content-Length: 3\r\n"),
              StartsWith("HTTP/1.1 400"));
}

TEST(WebMonitor, ReachesNoFile) {
  const Site site({"--lcm-url", own_url()});
  for (const char* path : {"/../etc/passwd", "/../../../../../../etc/passwd", "//etc/passwd",
                           "/%2e%2e/%2e%2e/etc/passwd", "/etc/passwd", "/monitor/main.js/..",
                           "/index.html", "/./", "/main.cpp", "/history"}) {
    EXPECT_THAT(site.get(path), StartsWith("HTTP/1.1 404")) << path;
  }
}

TEST(WebMonitor, EndsRequestsThatAreLongSlowOrNoRequests) {
  const Site site({"--lcm-url", own_url()});
  const std::string much(200'000, 'a');
  std::vector<Connection> bad;
  for (const std::string& text :
       {"GET /" + much + " HTTP/1.1\r\n" + site.host() + "\r\n",
        "GET / HTTP/1.1\r\n" + site.host() + "X: " + much + "\r\n\r\n", much,
        std::string(1000, '\0') + "\r\n\r\n", std::string("\x16\x03\x01\x02") + much}) {
    bad.emplace_back(site.port).say(text);
  }
  const Connection slow(site.port);
  slow.say("GET / HT");
  std::atomic<bool> ended = false;
  std::thread drip([&] {  // a byte now and then keeps nothing open
    while (!ended) {
      slow.say("x");
      std::this_thread::sleep_for(std::chrono::milliseconds(200));
    }
  });
  const auto begin = Clock::now();
  EXPECT_EQ(slow.hear(), "");
  EXPECT_LT(Clock::now() - begin, kHang);  // where hear() gives up
  ended = true;
  drip.join();
  for (const Connection& client : bad) EXPECT_THAT(client.hear(), Not(HasSubstr("200 OK")));
  EXPECT_THAT(site.get("/"), StartsWith("HTTP/1.1 200"));
}

TEST(WebMonitor, ServesPagesBesideThousandsOfConnections) {
  const Site site({"--lcm-url", own_url()});
  const Connection page = site.open_stream();
  ASSERT_THAT(page.hear("data: "), HasSubstr("data: "));
  for (int round = 0; round < 10; ++round) {
    std::vector<Connection> idle;
    for (int i = 0; i < 200; ++i) {
      idle.emplace_back(site.port);
      idle.back().say("GET / HTTP/1.1\r\n");
    }
    EXPECT_THAT(site.get("/setup"), StartsWith("HTTP/1.1 200"));
  }
  EXPECT_THAT(page.hear("data: "), HasSubstr("data: "));  // it was not cut off
}

TEST(WebMonitor, EndsWithPagesOpen) {
  Site site({"--lcm-url", own_url()});
  const Connection page = site.open_stream();
  ASSERT_THAT(page.hear("data: "), HasSubstr("data: "));
  site.monitor().send(SIGTERM);
  EXPECT_EQ(site.monitor().finish(), 0) << site.monitor().complaints();
  EXPECT_EQ(site.monitor().complaints(), "");
}

TEST(WebMonitor, OpensAFewStreamsOnly) {
  const Site site({"--lcm-url", own_url()});
  std::vector<Connection> pages;
  for (int i = 0; i < 8; ++i) {
    pages.push_back(site.open_stream());
    ASSERT_THAT(pages.back().hear("data: "), HasSubstr("data: "));
  }
  EXPECT_THAT(site.get("/stream"), StartsWith("HTTP/1.1 503"));
  pages.pop_back();
  std::string again;
  for (const auto end = Clock::now() + kHang;
       Clock::now() < end && !again.starts_with("HTTP/1.1 200");) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    again = site.open_stream().hear("\r\n\r\n");
  }
  EXPECT_THAT(again, StartsWith("HTTP/1.1 200"));
}

TEST(WebMonitor, ShowsALogAtAnyTime) {
  const Scratch scratch;
  const std::string log = short_log(scratch);
  Site site({"--log", log, "--config", scene("panda_release_c2")});
  const Json setup = body_of(site.get("/setup"));
  EXPECT_EQ(setup["live"], false);
  EXPECT_NEAR(setup["duration"].get<double>(), 0.999, 1e-9);
  EXPECT_EQ(setup["arm"]["joints"].size(), 7U);

  // This gives the same as reading the log from its beginning.
  lcmtypes::MessageHandlers handlers;
  state_t state{};
  modes_t modes{};
  handlers.on_state = [&state](const state_t& message) { state = message; };
  handlers.on_modes = [&modes](const modes_t& message) { modes = message; };
  lcmtypes::LogReader reader(log, handlers);
  int checked = 0;
  std::optional<std::int64_t> first;
  double smallest = std::numeric_limits<double>::infinity();
  while (reader.read()) {
    if (!first) first = reader.utime();
    reader.handle();
    for (const double ratio : modes.damping_ratio) smallest = std::min(smallest, ratio);
    if (modes.tick != state.tick || state.tick % 97 != 0) continue;
    const double time = 1e-6 * static_cast<double>(reader.utime() - *first);
    const Json frame = body_of(site.get("/frame?t=" + std::to_string(time)));
    ++checked;
    EXPECT_EQ(frame["state"]["tick"], state.tick);
    EXPECT_EQ(frame["state"]["joint_position"], Json(state.joint_position));
    EXPECT_EQ(frame["modes"]["tick"], modes.tick);
    EXPECT_EQ(frame["modes"]["damping_ratio"], Json(modes.damping_ratio));
    EXPECT_EQ(frame["alarms"]["smallest_ratio"].get<double>(), smallest);
  }
  EXPECT_GT(checked, 5);
  const Json end = body_of(site.get("/frame"));
  EXPECT_EQ(end["state"]["tick"], state.tick);
  for (const char* wrong : {"nan", "1e400", "-5", "x", "", "1%00"}) {
    EXPECT_THAT(site.get(std::string("/frame?t=") + wrong), StartsWith("HTTP/1.1 200")) << wrong;
  }
  const Json history = body_of(site.get("/history"));
  EXPECT_GT(history["time"].size(), 25U);
  EXPECT_EQ(history["mode"].size(), modes.label.size());
  site.monitor().send(SIGINT);
  EXPECT_EQ(site.monitor().finish(), 0);
}

TEST(WebMonitor, ShowsTheSmallestRatioOfTheTimeInWhichItIsWanted) {
  const Scratch scratch;
  const std::string log = scratch.path("panda.lcm");
  const std::string steps = changed(
      scratch, "panda_release_ratio_damping",
      {{"damping_ratio: 0.7", "damping_ratio: 0.2"},
       {"  start:", "  steps: [{at: 0.5 s, gains: {task: {damping_ratio: 0.7}}}]\n  start:"}});
  ASSERT_EQ(run_program({"run", steps, "--fast", "--duration", "2", "--log", log}).status, 0);
  Site site({"--log", log, "--config", steps});
  const Json before = body_of(site.get("/frame?t=0.4"))["alarms"];
  EXPECT_NEAR(before["smallest_ratio"].get<double>(), 0.2, 0.01);
  EXPECT_EQ(before["changes_of_ratio"], 0);
  const Json after = body_of(site.get("/frame?t=1.9"))["alarms"];
  EXPECT_NEAR(after["smallest_ratio"].get<double>(), 0.7, 0.01);
  EXPECT_GT(after["changes_of_ratio"], 0);
}

TEST(WebMonitor, ComputesTheResponseAtAPosture) {
  const Scratch scratch;
  const Site site({"--log", short_log(scratch), "--config", scene("panda_release_c2")});
  const Json frame = body_of(site.get("/frame?t=0"));
  const Json along_x = body_of(site.get("/response?at=tip/0&t=0"));
  // Statically the tip gives way as its spring of 2000 N/m does, and the modes are the loop's.
  EXPECT_EQ(along_x["unit"], "m/N");
  EXPECT_NEAR(along_x["magnitude"][0].get<double>(), 1 / 2000.0, 0.02 / 2000.0);
  EXPECT_EQ(along_x["zero_modes"].size(), 1U);
  for (std::size_t i = 0; i < 6; ++i) {
    const double seen = frame["modes"]["natural_frequency"][i].get<double>();
    EXPECT_NEAR(along_x["natural_frequency"][i].get<double>(), seen, 1e-6 * seen);
  }
  for (const char* wrong : {"joint/7", "tip/6", "joint/-1", "joint/x", "", "tip", "joint/1e9"}) {
    EXPECT_THAT(site.get(std::string("/response?at=") + wrong), StartsWith("HTTP/1.1 400"))
        << wrong;
  }
}

TEST(Export, WritesALineForEachModeOfEachMessage) {
  const Scratch scratch;
  const std::string log = short_log(scratch);
  const Outcome outcome = run_program({"export", log, "--csv", scratch.path("modes.csv")});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  std::istringstream table(scratch.read("modes.csv"));
  std::string line;
  std::getline(table, line);
  EXPECT_THAT(line, StartsWith("time [s],tick,label,natural_frequency [rad/s],damping_ratio,"));
  lcmtypes::MessageHandlers handlers;
  int rows = 0;
  handlers.on_modes = [&](const modes_t& message) {
    for (std::size_t i = 0; i < message.label.size(); ++i) {
      ASSERT_TRUE(std::getline(table, line));
      double time = 0, frequency = 0, ratio = 0;
      long long tick = 0;
      int label = 0;
      ASSERT_EQ(std::sscanf(line.c_str(), "%lf,%lld,%d,%lf,%lf,", &time, &tick, &label, &frequency,
                            &ratio),
                5);
      EXPECT_EQ(tick, message.tick);
      EXPECT_EQ(label, message.label[i]);
      EXPECT_EQ(frequency, message.natural_frequency[i]);
      EXPECT_EQ(ratio, message.damping_ratio[i]);
      ++rows;
    }
  };
  lcmtypes::LogReader reader(log, handlers);
  while (reader.read()) reader.handle();
  EXPECT_GT(rows, 100);
  EXPECT_FALSE(std::getline(table, line));
}

TEST(WebMonitor, AndExportRefuseBadInput) {
  const Scratch scratch;
  const std::string log = short_log(scratch), text = scratch.write("a.txt", "no log");
  const std::string no_modes = scratch.write("i", "{}"),
                    no_number = scratch.write("j", R"({"modes": [{"natural_frequency": "x"}]})");
  const Site first({"--log", log});
  expect_refusals(
      {"monitor"},
      {{{"--web", "0", "--log", text}, "--log: "},
       {{"--web", "0", "--log", "/nonexistent.lcm"}, "--log: "},
       {{"--web", "0", "--config", "/nonexistent.yaml"}, "/nonexistent.yaml"},
       {{"--web", "70000"}, "--web"},
       {{"--config", "x"}, "--web"},
       {{"--web", "0", "--log", log, "--identified", no_modes}, "\"modes\""},
       {{"--web", "0", "--log", log, "--identified", no_number}, "\"natural_frequency\""},
       {{"--web", std::to_string(first.port), "--log", log}, "in use"}});
  expect_refusals({"export"}, {{{log}, ""},
                               {{log, "--csv", log}, ""},
                               {{log, "--csv", scratch.path("x"), "--mcap", scratch.path("x")}, ""},
                               {{text, "--csv", scratch.path("y")}, ""},
                               {{"/nonexistent.lcm", "--csv", scratch.path("y")}, ""},
                               {{log, "--csv", "/nonexistent/y"}, ""}});
}

}  // namespace
}  // namespace dashpot::tests
