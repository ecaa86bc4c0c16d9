//! Classes and functions that pickles refer to by name.

use crate::pth::Dtype;

/// A class or function referenced by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Name<'a> {
    OrderedDict,
    RebuildTensor,
    RebuildParameter,
    Storage(Dtype),
    /// Module and name of anything else.
    Other(&'a str, &'a str),
}

/// Meaning of a name.
pub(super) fn name_of<'a>(module: &'a str, name: &'a str) -> Name<'a> {
    match (module, name) {
        ("collections", "OrderedDict") => Name::OrderedDict,
        ("torch._utils", "_rebuild_tensor_v2") => Name::RebuildTensor,
        ("torch._utils", "_rebuild_parameter" | "_rebuild_parameter_with_state") => {
            Name::RebuildParameter
        }
        ("torch", class) => {
            Dtype::from_storage(class).map_or(Name::Other(module, name), Name::Storage)
        }
        _ => Name::Other(module, name),
    }
}
