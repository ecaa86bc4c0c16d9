// Needs: nothing
// Offsets of harmonics, and the edited splats that are visible in an image.

struct Offsets {
    num_entries: u32,
    sh_degree: u32,
    // First row of the offsets of this dispatch.
    first_row: u32,
    num_rows: u32,
}

struct Entry {
    // Unit vector from the camera.
    towards: vec3f,
    // Row among the image's splats.
    splat: u32,
    // Colour without offsets, not clamped.
    color: vec3f,
    // Row of the offsets.
    row: u32,
}
