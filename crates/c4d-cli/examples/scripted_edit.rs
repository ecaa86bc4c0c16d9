//! Edits a frozen frame like an editor: recolours and inflates the splats in one box (with clones
//! and jitter), prunes another, grafts a block, and shuffles all rows.
//!
//! ```text
//! cargo run --release --example scripted_edit -- frozen/point_cloud.ply
//! edited.ply \ --recolour=-2,1,12,2,6,16 --color 0.1,0.5,0.2 --inflate
//! 0.1 --prune=3,2,10,6,4,14 --graft=0,-1,13,0.6
//! ```

use clap::Parser;
use gs_core::{Splats, SplitMix64, quat, sh};
use gs_io::{Existing, ply};
use std::error::Error;
use std::path::PathBuf;

#[derive(Debug, Parser)]
struct Args {
    /// Frozen frame
    input: PathBuf,
    /// Edited frame to write
    output: PathBuf,
    /// Box to recolour and inflate: x0,y0,z0,x1,y1,z1 in world units
    #[arg(long, value_delimiter = ',')]
    recolour: Vec<f32>,
    /// Colour of recoloured splats
    #[arg(long, value_delimiter = ',', default_value = "0.1,0.5,0.2")]
    color: Vec<f32>,
    /// Distance by which recoloured splats move away from the box's vertical axis, world units;
    /// half of them are cloned
    #[arg(long, default_value_t = 0.0)]
    inflate: f32,
    /// Box to prune
    #[arg(long, value_delimiter = ',')]
    prune: Vec<f32>,
    /// Block to graft: centre x,y,z and side
    #[arg(long, value_delimiter = ',')]
    graft: Vec<f32>,
    /// Keep the row order
    #[arg(long)]
    no_shuffle: bool,
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse();
    for (flag, values, wanted) in [
        ("--recolour", &args.recolour, 6),
        ("--color", &args.color, 3),
        ("--prune", &args.prune, 6),
        ("--graft", &args.graft, 4),
    ] {
        if !values.is_empty() && values.len() != wanted {
            return Err(format!("{flag} takes {wanted} numbers, found {}", values.len()).into());
        }
    }
    let source = ply::read_file(&args.input)?.splats;
    let mut random = SplitMix64::new(SplitMix64::GOLDEN);
    let mut edited = Splats::with_capacity(source.len(), source.sh_degree);
    let (mut recoloured, mut cloned, mut pruned) = (0, 0, 0);
    for i in 0..source.len() {
        if inside(source.means[i], &args.prune) {
            pruned += 1;
            continue;
        }
        edited.push_from(&source, i);
        if inside(source.means[i], &args.recolour) {
            recoloured += 1;
            paint(&mut edited, &args, &mut random);
            if args.inflate > 0.0 && i % 2 == 0 {
                cloned += 1;
                edited.push_from(&source, i);
                paint(&mut edited, &args, &mut random);
            }
        }
    }
    let grafted = graft(&mut edited, &args.graft);
    if !args.no_shuffle {
        let mut order: Vec<usize> = (0..edited.len()).collect();
        for i in (1..order.len()).rev() {
            order.swap(i, random.below(i + 1));
        }
        edited = edited.select(&order);
    }
    ply::write_file(&args.output, &edited, &ply::WriteOptions::default(), Existing::Replace)?;
    eprintln!(
        "{recoloured} recoloured, {cloned} cloned, {pruned} pruned, {grafted} grafted: {} splats",
        edited.len()
    );
    Ok(())
}

fn inside(point: [f32; 3], corners: &[f32]) -> bool {
    corners.len() == 6 && (0..3).all(|k| (corners[k]..=corners[k + 3]).contains(&point[k]))
}

/// Recolours the last splat, keeping its brightness, and moves it outwards with some jitter.
fn paint(splats: &mut Splats, args: &Args, random: &mut SplitMix64) {
    let (last, coeffs) = (splats.len() - 1, splats.sh_coeffs());
    let dc = splats.sh[last * coeffs];
    let brightness = (0.5 + sh::C0 * (dc[0] + dc[1] + dc[2]) / 3.0).clamp(0.05, 1.0);
    let rgb = [0, 1, 2].map(|c| (args.color[c] * (0.5 + brightness)).clamp(0.0, 1.0));
    splats.sh[last * coeffs] = sh::dc_from_rgb(rgb);
    for rest in &mut splats.sh[last * coeffs + 1..] {
        *rest = [0.0; 3];
    }
    if args.inflate > 0.0 {
        let middle = [0, 2].map(|k| f32::midpoint(args.recolour[k], args.recolour[k + 3]));
        let mean = &mut splats.means[last];
        let (dx, dz) = (mean[0] - middle[0], mean[2] - middle[1]);
        let norm = dx.hypot(dz).max(1e-6);
        let push = args.inflate * (0.8 + 0.4 * unit(random));
        mean[0] += dx / norm * push;
        mean[2] += dz / norm * push;
        mean[1] += args.inflate * 0.2 * (unit(random) - 0.5);
    }
}

/// A solid block of splats.
fn graft(splats: &mut Splats, block: &[f32]) -> usize {
    const PER_SIDE: u16 = 9;
    let &[x, y, z, side] = block else { return 0 };
    let spacing = side / f32::from(PER_SIDE - 1);
    let mut count = 0;
    for cell in 0..PER_SIDE.pow(3) {
        let steps = [cell % PER_SIDE, (cell / PER_SIDE) % PER_SIDE, cell / PER_SIDE / PER_SIDE];
        if !steps.iter().any(|&step| step == 0 || step == PER_SIDE - 1) {
            continue;
        }
        let offset = steps.map(|step| spacing * f32::from(step) - side / 2.0);
        splats.means.push([x + offset[0], y + offset[1], z + offset[2]]);
        splats.quats.push(quat::IDENTITY);
        splats.log_scales.push([(0.6 * spacing).ln(); 3]);
        splats.opacity_logits.push(4.0);
        let checker = if (steps[0] + steps[1] + steps[2]).is_multiple_of(2) { 0.9 } else { 0.7 };
        splats.sh.push(sh::dc_from_rgb([checker, 0.2, 0.15]));
        splats.sh.extend(std::iter::repeat_n([0.0; 3], splats.sh_coeffs() - 1));
        count += 1;
    }
    count
}

/// Uniform in [0, 1).
fn unit(random: &mut SplitMix64) -> f32 {
    (random.next_u64() >> 40) as f32 / (1_u64 << 24) as f32
}
