// Which files `dashpot identify` reads, and how it refuses others.
#include <dashpot/tests/apps/identify_run.hpp>

#include <functional>
#include <sstream>

namespace dashpot::tests {
namespace {

using ::testing::HasSubstr;

TEST(IdentifyFiles, TakesFilesAsPeopleAndRecordersWriteThem) {
  const Scratch scratch;
  const double degree = 57.29577951308232;
  std::string stamps = replaced(decay_csv("timestamp,q[0],q[1],q_d_0,tau_J_0,mode,", 1, 1e6), "\n",
                                ",0.7,0,kMove,\n");
  stamps.erase(stamps.find(",0.7,"), 13);  // of the line of names
  const std::string european = replaced(decay_csv("Time,q1 (rad),q2 (rad)", 1), ",", ";");
  const std::string dos =
      "\xEF\xBB\xBF# a comment\r\n" + replaced(decay_csv("timestamp,q1,q2", 1), "\n", "\r\n");
  const std::vector<std::string> texts = {
      replaced(decay_csv("\"t_ms\",q1 (deg),\"q2_deg\"", degree, 1000), ",", ";"),
      "# a recorder\n# " + replaced(decay_csv("time q_0 q_1", 1), ",", " "),
      replaced(european, ".", ","), dos, stamps};
  Json found;
  std::string file;
  for (const std::string& text : texts) {
    SCOPED_TRACE(text.substr(0, 60));
    file = scratch.write("file" + std::to_string(text.size()), text);
    found = identify({file});
    expect_known_modes(found);
  }
  EXPECT_THAT(found["notes"].dump(), HasSubstr("timestamp is taken to be in us"));
  EXPECT_THAT(found["notes"].dump(), HasSubstr("as they hold text: mode"));
  const std::string shorter = stamps.substr(0, stamps.rfind('\n', stamps.size() - 2) + 1);
  const Json both = identify({file, scratch.write("shorter", shorter)});
  EXPECT_EQ(both["records"].size(), 2U);
  EXPECT_EQ(both["postures"].size(), 1U);
}

/// Without names, and without a time.
TEST(IdentifyFiles, TakesFilesThatDoNotSayWhatTheyAre) {
  const Scratch scratch;
  const std::string plain = decay_csv("", 1).substr(1);
  expect_known_modes(identify({scratch.write("plain.csv", plain)}));
  expect_known_modes(
      identify({scratch.write("named.csv", plain), "--columns", "t,q1 [rad],q2 [rad]"}));
  std::string timeless;
  for (std::string_view rest = plain; !rest.empty(); rest.remove_prefix(rest.find('\n') + 1)) {
    timeless += rest.substr(rest.find(',') + 1, rest.find('\n') - rest.find(','));
  }
  expect_known_modes(identify({scratch.write("timeless.csv", timeless), "--rate", "500"}));
}

/// The decay with a stamp of its own for the sample at `i` times 2 ms.
std::string stamped(const std::string& heading, const std::function<std::string(int i)>& stamp) {
  std::istringstream rows(decay_csv("", 1).substr(1));
  std::string text = heading + "\n", row;
  for (int i = 0; std::getline(rows, row); ++i) text += stamp(i) + row.substr(row.find(',')) + "\n";
  return text;
}

/// Whole seconds lose their point, small times get an exponent, large ones have many digits; no
/// sample is lost in any of them.
TEST(IdentifyFiles, TakesTimesAsTheyAreWritten) {
  struct Stamps {
    const char* heading;
    std::function<std::string(int)> stamp;
    const char* note = nullptr;
  };
  const auto date = [](int i) {  // into the next day, and month
    const bool next = i >= 1000;
    return std::string(next ? "2026-02-01T00:00" : "2026-01-31T23:59") +
           printed(":%06.3fZ", next ? (i - 1000) * 0.002 : 58 + i * 0.002);
  };
  const auto jittered = [](int i) { return 2 * i + 0.05 * std::sin(40.0 * i); };  // ms
  const std::vector<Stamps> all = {
      {"stamp,speed [m/s^2],speed,q1,q2", [&](int i) { return date(i) + ",1,2"; }},
      {"stamp,q1,q2", date},
      {"time [s],q1,q2", [](int i) { return printed("%g", 0.5 + 0.002 * i); }},
      {"time [s],q1,q2", [](int i) { return printed("%g", -0.5 + 0.002 * i); }},
      {"time [s],q1,q2", [](int i) { return printed("%.3e", 0.002 * i); }},
      {"time [s],q1,q2", [](int i) { return printed("%.15g", 1'700'000'000.5 + 0.002 * i); }},
      {"time [s],q1,q2", [](int i) { return "170000000" + printed("%.9f", 0.25 + 0.002 * i); }},
      {"timestamp,q1,q2",
       [](int i) {
         return printed("17000%05.0f", 12345.0 + i / 500) + printed("%09.0f", i % 500 * 2e6);
       },
       "timestamp is taken to be in ns"},
      {"t,q1,q2", [&](int i) { return printed("%.4f", jittered(i)); }, "t is taken to be in ms"},
      {"t,q1,q2", [&](int i) { return printed("%.0f", 1e3 * jittered(i)); }, "to be in us"},
      {"duration,q1,q2", [](int i) { return printed("%g", 0.002 * i); }},
  };
  const Scratch scratch;
  for (const Stamps& stamps : all) {
    SCOPED_TRACE(stamps.heading + (": " + stamps.stamp(700)));
    const Json found =
        identify({scratch.write("stamps.csv", stamped(stamps.heading, stamps.stamp))});
    expect_known_modes(found);
    const std::string notes = found["notes"].dump();
    EXPECT_THAT(notes, HasSubstr(stamps.note == nullptr ? "[]" : stamps.note));
  }
}

TEST(IdentifyFiles, AskAboutUnitsOfTimeThatHardlyFit) {
  const Scratch scratch;
  for (const auto& [heading, by, question] :
       {std::tuple("t [s],q1,q2", 2.0, "t has steps of 2 s: is it in ms?"),
        {"t [ms],q1,q2", 0.002, "t has steps of 2e-06 s: is it in s?"}}) {
    const std::string file = scratch.write(
        "a.csv", stamped(heading, [step = by](int i) { return printed("%.3f", step * i); }));
    EXPECT_THAT(identify({file})["notes"].dump(), HasSubstr(question));
  }
}

/// Recorders and spreadsheets make such files; the modes are the same.
TEST(IdentifyFiles, TakesWhatRecordersAddAndLeaveOut) {
  const Scratch scratch;
  const std::string good = decay_csv("time,q1,q2", 1), rows = good.substr(good.find('\n') + 1);
  const auto with = [&rows](const std::string& heading, const std::string& end = "") {
    return heading + "\n" + rows + end;
  };
  const auto column = [&rows](const std::string& heading, const std::string& early,
                              const std::string& late) {
    std::string text = heading + "\n" + replaced(rows, "\n", "," + early + "\n");
    const std::size_t half = text.size() / 2;
    return text.substr(0, half) +
           replaced(text.substr(half), "," + early + "\n", "," + late + "\n");
  };
  const std::vector<std::string> texts = {
      with("Recorder 3.1\nArm: iiwa, at 500 Hz\n\ntime,q1,q2"),
      with("# recorded on a Friday"),
      with("time,q1,q2\ns,rad,rad"),
      with("date,Angle1 [radians],Angle2 [radians]"),
      with("__time,/joint_states/position[0],/joint_states/position[1]"),
      with("% time,field.position0,field.position1"),
      with("time,q1,q2", "\n\n  \n,,\n"),
      with("time,q1,q2", "2.4001,0.00"),  // whose end was not written
      replaced(good, "\n", "\r"),
      column("time,q1,q2,note", "", "hit"),
      column("time,q1,q2,q3 [A]", "NA", "null"),
      replaced(column("time,q1,q2,q3 [A]", "5", ""), ",", "\t"),
  };
  for (const std::string& text : texts) {
    SCOPED_TRACE(text.substr(0, 60));
    expect_known_modes(identify({scratch.write("file.csv", text)}));
  }
  std::string degrees = decay_csv("Time (sec),q1 (\xC2\xB0),q2 (degrees)", 57.29577951308232);
  const std::size_t comma = degrees.find(',', degrees.size() / 2);
  degrees.replace(comma + 1, degrees.find(',', comma + 1) - comma - 1, "n/a");
  expect_known_modes(identify({scratch.write("degrees.csv", degrees)}));
  expect_refusal(run_program({"identify", scratch.write("note.csv", column("time,q1,q2", "", "x")),
                              "--columns", "time,q1,q2,q3", "--channels", "q1,q3"}),
                 "q3: 'x' is not a number");
}

/// Rows with the same cells at the end of each.
std::string with_columns(const std::string& heading, const std::string& cells) {
  const std::string good = decay_csv("", 1).substr(1);
  return heading + "\n" + replaced(good, "\n", cells + "\n");
}

/// `run --csv` has the position and errors of the tip beside the joints.
TEST(IdentifyFiles, TakesTheJointsAloneWhereTheTipIsBesideThem) {
  const Scratch scratch;
  const std::string file = scratch.write(
      "run.csv", with_columns("time [s],q1 [rad],q2 [rad],x [m],error_x [m],error_rx [rad]",
                              ",0.5,0.1,0.001"));
  const Json found = identify({file});
  expect_known_modes(found);
  EXPECT_THAT(found["notes"].dump(),
              HasSubstr("left out beside the positions of joints: x, error_x, error_rx"));
  // The tip alone is a motion like any other.
  const std::string tip = scratch.write("tip.csv", decay_csv("time [s],x [m],y [m]", 1));
  const Json alone = identify({tip});
  expect_known_modes(alone);
  EXPECT_EQ(alone["notes"].size(), 0U) << alone["notes"];
}

TEST(IdentifyFiles, SaysWhichPositionsHaveAnUnknownUnit) {
  const Scratch scratch;
  const std::string file = scratch.write(
      "units.csv", with_columns("time [s],q1 [rad],q2 [rad],q3 [furlong],i [A]", ",0.5,0.1"));
  EXPECT_THAT(identify({file})["notes"].dump(),
              HasSubstr("left out, as rad, mrad, deg, m, cm or mm is wanted: q3 [furlong]\""));
  const double degree = 57.29577951308232;
  const std::string degrees =
      scratch.write("degrees.csv", decay_csv("Time [Sec],q1 [Deg],q2_DEG", degree));
  const Json found = identify({degrees});
  expect_known_modes(found);
  EXPECT_EQ(found["notes"].size(), 0U) << found["notes"];
}

TEST(IdentifyFiles, SaysThatAForceMayBeAnInput) {
  const Scratch scratch;
  const std::string file = scratch.write(
      "force.csv", with_columns("time [s],q1 [rad],q2 [rad],f [N],tau [N m]", ",0,0"));
  const std::string notes = identify({file})["notes"].dump();
  EXPECT_THAT(notes, HasSubstr("f [N] is a force: if it was put in from outside, --inputs f"));
  EXPECT_THAT(notes, HasSubstr("tau [N m] is a torque: if it was put in"));
  const std::string joints = scratch.write(
      "torques.csv", with_columns("time [s],q1 [rad],q2 [rad],tau1 [N m],tau2 [N m]", ",0,0"));
  EXPECT_EQ(identify({joints})["notes"].size(), 0U);
}

/// With --rate a first column that rises to the end is the time, which the rate replaces.
TEST(IdentifyFiles, TakesNoTimeForAChannel) {
  const Scratch scratch;
  const std::string file = scratch.write("plain.csv", decay_csv("", 1).substr(1));
  const Json found = identify({file, "--rate", "500"});
  expect_known_modes(found);
  EXPECT_THAT(found["notes"].dump(), HasSubstr("taken for the time, and --rate stands in its"));
}

TEST(IdentifyFiles, LeavesOutWhatIsMissingOrTwiceAndSaysSo) {
  const Scratch scratch;
  std::string text = decay_csv("time [s],q1 [rad],q2 [rad],note", 1), with_holes;
  int line = 0;
  for (std::size_t at = 0; at < text.size(); ++line) {
    const auto end = text.find('\n', at);
    std::string row = text.substr(at, end - at);
    at = end + 1;
    if (line > 0) row += ",";
    if (line % 50 == 7) row = row.substr(0, row.find(',')) + ",,nan,";
    with_holes += row + "\n";
    if (line == 300) with_holes += row + "\n0.1,1,2,3\n";  // twice, and back in time
  }
  const Json found = identify({scratch.write("a.csv", with_holes), "--channels", "q1,q2"});
  expect_known_modes(found);
  EXPECT_THAT(found["notes"].dump(), HasSubstr("1 samples left out, because another has the same"));
  EXPECT_THAT(found["notes"].dump(), HasSubstr("time runs backwards"));
}

TEST(IdentifyFiles, RefusesInOneLineThatNamesFileLineAndColumn) {
  const Scratch scratch;
  const std::string good = decay_csv("time [s],q1 [rad],q2 [rad]", 1);
  int number = 0;
  const auto file = [&](const std::string& text) {
    return scratch.write("bad" + std::to_string(number++) + ".csv", text);
  };
  expect_refusals(
      {"identify"},
      {
          {{file("")}, "is empty"},
          {{file("time,q1\n")}, "0 samples, need 20"},
          {{file(stamped("time,q1,q2", [](int i) { return printed("%.6g", 1.7e9 + i); }))},
           "1 samples, need 20 or more; 1199 more have the time of another: it needs more digits"},
          {{file("time,time,q1\n1,2,3\n")}, "two columns of time"},
          {{file("a,b\n1,2\n")}, "line 1: no column of time"},
          {{file("0,1\n1,2\n1,3\n")}, "line 1: numbers, where a line of names"},
          {{file("recorder\n\na,b\n1,2\n")}, "line 3: no column of time"},
          {{file("time,q1\n12:00:00,2\n")}, "line 2, time: '12:00:00' is not a time"},
          {{file("\xFF\xFEt\n")}, "is text in UTF-16: save it as UTF-8"},
          {{file("SQLite format 3 of a bag")}, "dashpot.read_log(FILE)"},
          {{file(good), "--rate", "nan"}, "--rate: has to be a finite number"},
          {{file(replaced(good, "\n1.", ",7\n1.")), "--columns", "t,q1,q2"}, "not 3 columns"},
          {{file("time\n1\n")}, "no column but the time"},
          {{file("time [kg],q1\n1,2\n")}, "in kg, a time is wanted"},
          {{file(replaced(good, "q1 [rad],q2 [rad]", "q [m/s^2],p [furlong]"))},
           "--channels: no column is known to be a position"},
          {{file(replaced(good, "q2", "q1"))}, "two columns are called 'q1': --columns"},
          {{file(good), "--from", "nan"}, "--from: has to be a finite time"},
          {{file(good), "--from", "2", "--to", "1"}, "--from: has to be before --to"},
          {{file("time,q1\n1,2\n2\n")}, "line 3: not 2 columns"},
          {{file("time,q1\n1,2,3\n")}, "line 2: not 2 columns"},
          {{file("time,q1\n1,2\n2,x\n")}, "line 3, q1: 'x' is not a number"},
          {{file("time,q1\nnan,2\n")}, "line 2: no time"},
          {{file(std::string("\x7f"
                             "ELF\0\0\1",
                             7))},
           "no column of time"},
          {{file(good), "--inputs", "torque"}, "--inputs: no channel 'torque'; there are q1"},
          {{file(good), "--inputs", "q1", "--channels", "q1,q2"}, "'q1' is among --inputs"},
          {{file(good), "--excited"}, "--excited: needs --inputs"},
          {{file(good), "--channels", "q9"}, "no channel 'q9'; there are q1, q2"},
          {{file(good), "--channels", "q1,q1"}, "'q1' twice"},
          {{scratch.write("a.csv", good), scratch.write("b.csv", good)}, "b.csv: is a copy of "},
          {{file(good), "--from", "7"},
           "0 samples from --from to --to, s after the file's first sample"},
          {{file("time,x\n" + good.substr(good.find('\n') + 1, 3000))}, "columns"},
          {{file(good), file(decay_csv("time,q1,q3", 1))}, "its channels differ"},
          {{file(good), "--calibrate", "payload"}, "--against"},
          {{file(good), "--plot", "x.pdf"}, "--plot: x.pdf: has to end"},
          {{file(good), "--plot", scratch.path("none/x.svg")}, "x.svg: there is no folder"},
          {{file("time [s],label,natural_frequency [rad/s]\n0,1,2\n")},
           "has modes in place of motion"},
          {{scratch.path("none.csv")}, "none.csv"},
          {{scratch.path("")}, "cannot be read"},
      });
}

}  // namespace
}  // namespace dashpot::tests
