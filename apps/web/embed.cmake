# Writes the files of page/, and a document that it links to, into a source file, as the program
# serves them: cmake -P, with OUT, PAGE.
set(text "#include <dashpot/apps/web/web_site.hpp>\n\nnamespace dashpot::apps {\nnamespace {\n")
set(table "")
foreach(entry IN ITEMS "index.html:text/html" "style.css:text/css" "main.js:text/javascript"
    "draw.js:text/javascript" "arm.js:text/javascript" "poles.js:text/javascript"
    "curves.js:text/javascript" "tune.html:text/html" "tune.css:text/css"
    "tune.js:text/javascript" "tune_arm.js:text/javascript" "tune_form.js:text/javascript"
    "tune_gains.js:text/javascript" "tune_state.js:text/javascript" "tune_text.js:text/javascript"
    "panels.js:text/javascript" "advice.js:text/javascript"
    "icon.svg:image/svg+xml" "../../../docs/safety.md:text/plain")
  string(REPLACE ":" ";" entry ${entry})
  list(GET entry 0 name)
  list(GET entry 1 type)
  file(READ ${PAGE}/${name} hex HEX)
  string(LENGTH "${hex}" length)
  math(EXPR length "${length} / 2")
  string(REGEX REPLACE "(..)" "\\\\x\\1" hex "${hex}")
  string(REGEX REPLACE "(................................................................................)" "\\1\"\n  \"" hex "${hex}")
  string(MAKE_C_IDENTIFIER ${name} id)
  string(APPEND text "constexpr char k_${id}[] =\n  \"${hex}\";\n")
  get_filename_component(file ${name} NAME)
  set(path "/${file}")
  if(name STREQUAL "index.html")
    set(path "/")
  endif()
  string(APPEND table
    "    {\"${path}\", \"${type}; charset=utf-8\", {k_${id}, ${length}}},\n")
endforeach()
string(APPEND text "constexpr PageFile kPageFiles[] = {\n${table}};\n}  // namespace\n
const PageFile* find_page_file(std::string_view path) {
  for (const PageFile& file : kPageFiles) {
    if (file.path == path) return &file;
  }
  return nullptr;
}

}  // namespace dashpot::apps\n")
file(WRITE ${OUT} "${text}")
