#pragma once
#include <dashpot/analysis/spectrum.hpp>

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <string>

namespace dashpot::apps {

/// Every number of a report can be read back exactly; NaN and infinity are null.
using Json = nlohmann::ordered_json;

/// Returns [re, im].
Json json_complex(const analysis::Complex& value);
/// Returns the entries of a vector.
template <class Derived>
Json json_list(const Eigen::MatrixBase<Derived>& vector) {
  Json list = Json::array();
  for (Eigen::Index i = 0; i < vector.size(); ++i) {
    if constexpr (Eigen::NumTraits<typename Derived::Scalar>::IsComplex) {
      list.push_back(json_complex(vector(i)));
    } else {
      list.push_back(vector(i));
    }
  }
  return list;
}
/// Returns a list for each row.
Json json_rows(const Eigen::MatrixXd& matrix);

/// Returns the modes of a spectrum. docs/command-line.md lists the keys.
Json modes_json(const analysis::Spectrum<>& spectrum);

/// Returns figures, source and doubt of the published drives of this name.
Json drives_json(const std::string& name);

/// Returns the text of a document: objects take a line for each item, numbers and matrices stay on
/// one.
std::string json_text(const Json& document);

}  // namespace dashpot::apps
