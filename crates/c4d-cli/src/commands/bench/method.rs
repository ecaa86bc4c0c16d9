//! The methods compared.

use crate::failure::{Failure, Outcome};
use crate::field::NetworkField;
use amg::{
    Aggregation, AnchorSampling, Binding, EditedScene, MotionGuide, MotionOptions, MotionPreset,
    PaperParams,
};
use gs_core::DynamicScene;
use gs_deform::HexPlaneScene;
use gs_io::DeformedModel;
use gs_synth::{PartBy, TruthScene, part_neighbors, rigid_neighbors};
use serde::Serialize;
use std::sync::Arc;

/// A method with its settings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Method {
    /// A deformation network trained on the source and evaluated at the edited splats (the paper's
    /// "DeformNet-Guide").
    Network,
    /// Three nearest source splats, all rows (the paper's KNN-Guide).
    Knn,
    /// The paper's method, taken literally, for all rows.
    Paper,
    /// The paper's method with anchors from farthest-point sampling instead of lines.
    PaperFarthest,
    /// Rigid motion of the part of the nearest source splat with a similar normal; uses the true
    /// parts and floaters.
    Nearest,
    /// Rigid motion around the nearest source splat with a similar normal; uses no ground truth.
    Control,
    /// The default.
    Default,
    /// The default without the identity map: it estimates all rows, as the baselines do.
    DefaultAll,
    /// The default, with the trained network as the source instead of the scene.
    DefaultOnNetwork,
    /// Rigid motion of the true part.
    Floor,
}

pub(super) const METHODS: [Method; 10] = [
    Method::Network,
    Method::Knn,
    Method::Paper,
    Method::PaperFarthest,
    Method::Nearest,
    Method::Control,
    Method::Default,
    Method::DefaultAll,
    Method::DefaultOnNetwork,
    Method::Floor,
];

impl Method {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Network => "network on the edit",
            Self::Knn => "KNN-Guide",
            Self::Paper => "paper, literal",
            Self::PaperFarthest => "paper, farthest points",
            Self::Nearest => "nearest, parts known",
            Self::Control => "nearest, no transport",
            Self::Default => "c4d",
            Self::DefaultAll => "c4d, all rows",
            Self::DefaultOnNetwork => "c4d, source a network",
            Self::Floor => "floor: true parts",
        }
    }

    /// Whether the method needs a trained network.
    pub(super) fn on_network(self) -> bool {
        matches!(self, Self::Network | Self::DefaultOnNetwork)
    }

    /// The edited scene. Baselines estimate every row, as in the paper; the default keeps the
    /// motion of unedited splats.
    pub(super) fn apply(
        self,
        scene: &TruthScene,
        network: Option<&Arc<HexPlaneScene>>,
    ) -> Outcome<EditedScene> {
        let edited = Arc::new(scene.edited.splats.clone());
        let plain = || -> Arc<dyn DynamicScene> { Arc::new(scene.source.clone()) };
        let trained = || network.cloned().ok_or_else(|| Failure::failed("no network was trained"));
        let (source, mut options): (Arc<dyn DynamicScene>, _) = match self {
            Self::Network => {
                let network = trained()?;
                let field = Arc::new(NetworkField(DeformedModel::HexPlane(Arc::clone(&network))));
                (network, MotionOptions::field(field))
            }
            Self::Knn => (plain(), MotionOptions::preset(MotionPreset::Knn)),
            Self::Paper => (plain(), MotionOptions::preset(MotionPreset::Paper)),
            Self::PaperFarthest => {
                let params = PaperParams {
                    sampling: AnchorSampling::FarthestPoints,
                    ..PaperParams::default()
                };
                let guide = MotionGuide::Paper(params);
                (plain(), MotionOptions::preset(MotionPreset::Paper).with_guide(guide))
            }
            Self::Default | Self::DefaultAll => (plain(), MotionOptions::default()),
            Self::DefaultOnNetwork => (trained()?, MotionOptions::default()),
            Self::Nearest => return oracle(scene, Some(PartBy::Nearness), plain(), edited),
            Self::Control => return oracle(scene, None, plain(), edited),
            Self::Floor => return oracle(scene, Some(PartBy::Truth), plain(), edited),
        };
        options.identity.enabled = matches!(self, Self::Default | Self::DefaultOnNetwork);
        let found =
            amg::propagate(source, edited, &options, &|_, _| {}).map_err(Failure::failed)?;
        Ok(found.scene)
    }
}

fn oracle(
    scene: &TruthScene,
    by: Option<PartBy>,
    source: Arc<dyn DynamicScene>,
    edited: Arc<gs_core::Splats>,
) -> Outcome<EditedScene> {
    let rows = match by {
        Some(by) => part_neighbors(&scene.source, &scene.edited, by),
        None => rigid_neighbors(&scene.source, &scene.edited),
    };
    let rows = rows.map_err(Failure::failed)?;
    let binding = Binding::blending(&rows, source.num_splats()).map_err(Failure::failed)?;
    EditedScene::new(source, edited, 0.0, Arc::new(binding), Aggregation::default())
        .map_err(Failure::failed)
}
