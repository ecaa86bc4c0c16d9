//! Writes a deformation network and its splats as a model folder.

use crate::error::IoError;
use crate::fs::{AtomicDir, Existing};
use crate::ply::{self, WriteOptions};
use crate::pth::{self, NamedTensor};
use gs_core::Splats;
use gs_deform::{Component, HexPlaneNetwork, Linear, Mask, Plane};
use std::fmt::Write as _;
use std::path::Path;

/// Writes `canonical` and `network` as iteration `number` of a model folder that
/// both the reference implementation and [`super::open`] can read. All tensors of
/// the reference are written, unused ones as zeros.
///
/// # Errors
/// If the network has a mask (not supported, because such training runs are rare), or `dir` must
/// not be replaced or cannot be written.
pub fn write(
    dir: &Path,
    number: u64,
    canonical: &Splats,
    network: &HexPlaneNetwork,
    existing: Existing,
) -> Result<(), IoError> {
    if network.mask != Mask::One {
        return Err(IoError::content(
            dir,
            "networks with a mask cannot be written, expected one without",
        ));
    }
    let folder = AtomicDir::create(dir, existing)?;
    let failed = |source| IoError::Write { path: dir.to_owned(), source };
    let iteration = folder.path().join("point_cloud").join(format!("iteration_{number}"));
    std::fs::create_dir_all(&iteration).map_err(failed)?;
    let ply = std::fs::File::create_new(iteration.join("point_cloud.ply")).map_err(failed)?;
    let mut ply = std::io::BufWriter::new(ply);
    ply::write(canonical, &WriteOptions::default(), &mut ply).map_err(failed)?;
    std::io::Write::flush(&mut ply).map_err(failed)?;
    let tensors = tensors(network);
    let named: Vec<NamedTensor<'_>> =
        tensors.iter().map(|(name, shape, values)| NamedTensor { name, shape, values }).collect();
    let file = std::fs::File::create_new(iteration.join("deformation.pth")).map_err(failed)?;
    pth::write(&named, std::io::BufWriter::new(file)).map_err(failed)?;
    let text = cfg_args(canonical, network);
    std::fs::write(folder.path().join("cfg_args"), text).map_err(failed)?;
    folder.commit()
}

type Named = (String, Vec<usize>, Vec<f32>);

/// All tensors of the reference's network, in its order.
fn tensors(network: &HexPlaneNetwork) -> Vec<Named> {
    let powers = |n: usize| (0..n).map(|i| f32::from(1_u16 << i)).collect::<Vec<f32>>();
    let mut out: Vec<Named> =
        [("time_poc", 4), ("pos_poc", 10), ("rotation_scaling_poc", 2), ("opacity_poc", 2)]
            .into_iter()
            .map(|(name, n)| (name.to_owned(), vec![n], powers(n)))
            .collect();
    push_linear(&mut out, "timenet.0", 9, &zeros(9, 64));
    push_linear(&mut out, "timenet.2", 64, &zeros(64, 32));
    let planes = &network.planes;
    out.push((
        "deformation_net.grid.aabb".to_owned(),
        vec![2, 3],
        planes.aabb.as_flattened().to_vec(),
    ));
    for (l, level) in planes.levels.iter().enumerate() {
        for (p, plane) in level.iter().enumerate() {
            let name = format!("deformation_net.grid.grids.{l}.{p}");
            let shape = vec![1, planes.channels, plane.rows, plane.columns];
            out.push((name, shape, channels_first(plane, planes.channels)));
        }
    }
    let mut width = planes.num_features() * if network.grid_pe == 0 { 1 } else { 3 };
    for (d, layer) in network.trunk.iter().enumerate() {
        push_linear(&mut out, &format!("deformation_net.feature_out.{}", 2 * d), width, layer);
        width = layer.num_outputs();
    }
    for component in Component::ALL {
        let name = component.head_name();
        let unused = (zeros(width, width), zeros(width, component.num_outputs()));
        let (hidden, last) = network
            .heads
            .get(component)
            .map_or((&unused.0, &unused.1), |head| (&head.hidden, &head.out));
        push_linear(&mut out, &format!("deformation_net.{name}.1"), width, hidden);
        let inner = hidden.num_outputs();
        push_linear(&mut out, &format!("deformation_net.{name}.3"), inner, last);
    }
    out
}

fn zeros(inputs: usize, outputs: usize) -> Linear {
    Linear { weight: vec![0.0; inputs * outputs], bias: vec![0.0; outputs] }
}

fn push_linear(out: &mut Vec<Named>, name: &str, inputs: usize, layer: &Linear) {
    let outputs = layer.num_outputs();
    out.push((format!("{name}.weight"), vec![outputs, inputs], layer.weight.clone()));
    out.push((format!("{name}.bias"), vec![outputs], layer.bias.clone()));
}

/// `[rows, columns, C]` to `[C, rows, columns]`.
fn channels_first(plane: &Plane, channels: usize) -> Vec<f32> {
    (0..channels).flat_map(|c| plane.texels.iter().skip(c).step_by(channels).copied()).collect()
}

fn cfg_args(canonical: &Splats, network: &HexPlaneNetwork) -> String {
    let python = |flag: bool| if flag { "True" } else { "False" };
    let planes = &network.planes;
    let [base, ..] = planes.levels.as_slice() else { return String::from("Namespace()") };
    let multires: Vec<String> = planes
        .levels
        .iter()
        .map(|level| (level[0].columns / base[0].columns).to_string())
        .collect();
    let mut text = format!(
        "Namespace(sh_degree={}, white_background=True, net_width={}, defor_depth={}, grid_pe={}, apply_rotation={}, static_mlp=False, empty_voxel=False, no_grid=False, multires=[{}], kplanes_config={{'grid_dimensions': 2, 'input_coordinate_dim': 4, 'output_coordinate_dim': {}, 'resolution': [{}, {}, {}, {}]}}, timebase_pe=4, posebase_pe=10, scale_rotation_pe=2, opacity_pe=2, timenet_width=64, timenet_output=32",
        canonical.sh_degree,
        network.trunk.last().map_or(0, Linear::num_outputs),
        network.trunk.len(),
        network.grid_pe,
        python(network.apply_rotation),
        multires.join(", "),
        planes.channels,
        base[0].columns,
        base[0].rows,
        base[1].rows,
        base[2].rows,
    );
    for (component, flag) in
        Component::ALL.into_iter().zip(["no_dx", "no_ds", "no_dr", "no_do", "no_dshs"])
    {
        let off = network.heads.get(component).is_none();
        // Writing to a string cannot fail.
        let _ = write!(text, ", {flag}={}", python(off));
    }
    text.push(')');
    text
}
