# Writes the files of page/, and a document that it links to, into a source file, as the program
# serves them at their paths: cmake -P, with OUT, PAGE.
set(type_html text/html)
set(type_css text/css)
set(type_js text/javascript)
set(type_svg image/svg+xml)
set(type_md text/plain)
set(text "#include <dashpot/apps/web/web_site.hpp>\n\nnamespace dashpot::apps {\nnamespace {\n")
set(table "")
file(GLOB_RECURSE names RELATIVE ${PAGE} ${PAGE}/*)
foreach(name IN LISTS names ITEMS ../../../docs/safety.md)
  file(READ ${PAGE}/${name} hex HEX)
  string(LENGTH "${hex}" length)
  math(EXPR length "${length} / 2")
  string(REGEX REPLACE "(..)" "\\\\x\\1" hex "${hex}")
  string(REGEX REPLACE "(................................................................................)" "\\1\"\n  \"" hex "${hex}")
  string(MAKE_C_IDENTIFIER ${name} id)
  string(APPEND text "constexpr char k_${id}[] =\n  \"${hex}\";\n")
  string(REGEX REPLACE "^[./]+docs/" "" path ${name})
  string(REGEX REPLACE "^index.html$" "" path ${path})
  get_filename_component(end ${name} LAST_EXT)
  string(REPLACE "." "type_" type ${end})
  string(APPEND table
    "    {\"/${path}\", \"${${type}}; charset=utf-8\", {k_${id}, ${length}}},\n")
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
