//! Records of a COLMAP model as stored.

/// A lens of a COLMAP model.
#[derive(Debug, Clone, PartialEq)]
pub struct ColmapCamera {
    /// Id, to which images refer.
    pub id: u32,
    /// COLMAP's name of the lens model.
    pub model: &'static str,
    /// Image columns, pixels.
    pub width: u64,
    /// Image rows, pixels.
    pub height: u64,
    /// Parameters in the order of the lens model: focal lengths and principal point in pixels, then
    /// distortion without unit.
    pub params: Vec<f64>,
}

/// A registered image of a COLMAP model.
#[derive(Debug, Clone, PartialEq)]
pub struct ColmapImage {
    /// Id of the image.
    pub id: u32,
    /// Rotation world to camera, wxyz.
    pub quat: [f64; 4],
    /// Translation world to camera, world units.
    pub translation: [f64; 3],
    /// Id of the image's lens.
    pub camera_id: u32,
    /// File name, including folders.
    pub name: String,
}
