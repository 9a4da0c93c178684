// dashpot._core: the C++ functions as the package dashpot calls them. Users see python/dashpot.

#include <dashpot/controller/input_error.hpp>
#include <dashpot/python/src/convert.hpp>

#include <stdexcept>

namespace dashpot::python {
namespace {

/// Refused input becomes dashpot.Error.
void translate(const std::exception_ptr& thrown, void* error_type) {
  const auto raise = [&](const std::exception& error) {
    PyErr_SetString(static_cast<PyObject*>(error_type), error.what());
  };
  try {
    std::rethrow_exception(thrown);
  } catch (const std::invalid_argument& error) {
    raise(error);
  } catch (const std::domain_error& error) {
    raise(error);
  } catch (const controller::InputError& error) {
    raise(error);
  }
}

}  // namespace
}  // namespace dashpot::python

NB_MODULE(_core, m) {
  using namespace dashpot::python;  // NOLINT(google-build-using-namespace): a macro's function
  nb::set_leak_warnings(false);     // other packages may keep our objects until the end
  PyObject* const error = PyErr_NewException("dashpot.Error", PyExc_ValueError, nullptr);
  if (error == nullptr) nb::raise_python_error();
  m.attr("Error") = nb::steal(error);
  m.attr("__build__") = DASHPOT_ARCH;
  nb::register_exception_translator(translate, error);
  add_analysis(m);
  add_design(m);
  add_robot(m);
  add_controller(m);
  add_log(m);
  add_audit(m);
  add_identification(m);
}
