//! Anchors of a cloud and of an edited copy of it, probed with the same lines.

#![expect(clippy::print_stdout, reason = "an example shows its result")]

use anchors::{AnchorError, AnchorParams, AnchorSet, KdTree};

fn main() -> Result<(), AnchorError> {
    // A torus; the edit lifts its right half, and a few stray points appear.
    let src: Vec<[f32; 3]> = (0..20_000_u16).map(torus).collect();
    let mut edit: Vec<[f32; 3]> =
        src.iter().map(|&[x, y, z]| [x, y, if x > 0.0 { z + 0.1 } else { z }]).collect();
    edit.extend((0..200_u16).map(|i| torus(i * 97).map(|x| 1.7 * x)));

    let params = AnchorParams::default();
    let (anchors_src, anchors_edit) = AnchorSet::of_pair(&src, &edit, &params)?;

    for (name, points, set) in [("source", &src, &anchors_src), ("edited", &edit, &anchors_edit)] {
        println!(
            "{name}: {} points, {} anchors, δ = {:.4}, {} points uncovered",
            points.len(),
            set.len(),
            set.delta,
            set.num_uncovered()
        );
    }
    let strays = &anchors_edit.owners[src.len()..];
    let covered = strays.iter().filter(|owner| **owner != anchors::NO_ANCHOR).count();
    println!("{covered} of {} stray points got an anchor", strays.len());

    // Distance of each edited anchor from the nearest source anchor.
    let tree = KdTree::new(&anchors_src.positions);
    let mut found = Vec::new();
    let mut moved = 0;
    for position in &anchors_edit.positions {
        tree.nearest(position, 1, &mut found);
        moved += usize::from(found[0].distance_squared.sqrt() > 2.0 * anchors_src.delta);
    }
    println!("{moved} edited anchors are more than 2δ from every source anchor");
    Ok(())
}

/// A point of a torus; low-discrepancy angles cover it evenly.
fn torus(i: u16) -> [f32; 3] {
    let turn = |step: f32| (f32::from(i) * step).fract() * std::f32::consts::TAU;
    let (a, b) = (turn(0.754_877_7), turn(0.569_840_3));
    let ring = 1.0 + 0.35 * b.cos();
    [ring * a.cos(), ring * a.sin(), 0.35 * b.sin()]
}
