//! Prints the contents of the demo scene, its edit and the truth cases.
#![expect(clippy::print_stdout, reason = "an example reports to the terminal")]

use gs_core::DynamicScene;
use gs_synth::{DemoParams, TruthCase, apply_edits, build, demo, demo_edits, motion_error};

fn main() -> Result<(), gs_synth::SynthError> {
    let scene = demo(&DemoParams { trajectory_noise: 0.0005, ..DemoParams::default() })?;
    let edited = apply_edits(&scene, &demo_edits(), 0)?;
    let count = |mask: &[bool]| mask.iter().filter(|&&mark| mark).count();
    println!("demo: {} splats, {} of them move", scene.num_splats(), count(&scene.moving_mask()));
    println!(
        "edit: {} splats, {} scored, {} in contact zones",
        edited.splats.len(),
        count(&edited.truth.eval_mask),
        count(&edited.truth.contact_mask),
    );
    println!("{:>22} {:>7} {:>8} {:>22}", "case", "edited", "contact", "EPE of no motion");
    for case in TruthCase::ALL {
        let built = build(case, 0, 5_000)?;
        let truth = &built.edited.truth;
        let still = Still(truth.at(0.0)?);
        let score = motion_error(&still, truth, &[0.25, 0.5, 0.75, 1.0])?;
        println!(
            "{:>22} {:>7} {:>8} {:>21.1}%",
            case.name(),
            truth.num_splats(),
            score.num_contact,
            score.epe
        );
    }
    Ok(())
}

/// A prediction without motion.
#[derive(Debug)]
struct Still(gs_core::Splats);

impl DynamicScene for Still {
    fn num_splats(&self) -> usize {
        self.0.len()
    }

    fn sh_degree(&self) -> usize {
        self.0.sh_degree
    }

    fn time_range(&self) -> gs_core::TimeRange {
        gs_core::TimeRange::UNIT
    }

    fn at_into(&self, _t: f32, out: &mut gs_core::Splats) -> Result<(), gs_core::SceneError> {
        out.clone_from(&self.0);
        Ok(())
    }
}
