//! Written PLY sequences are read back exactly; archives contain
//! the same files; no partial output remains.

use gs_core::{DynamicScene, SceneError, Splats, TimeRange};
use gs_deform::TabulatedScene;
use gs_io::ply::{self, WriteOptions};
use gs_io::ply_sequence::{FolderWriter, PlySequence, SequenceOptions, write_folder, write_zip};
use gs_io::repair::Damage;
use gs_io::{Existing, IoError};
use std::fs;
use std::path::Path;

fn frame(i: u8, n: usize) -> Splats {
    let x = f32::from(i);
    Splats {
        means: (0..n).map(|row| [x, row as f32, -x]).collect(),
        quats: vec![[1.0, x / 8.0, 0.0, 0.0]; n],
        log_scales: vec![[-x; 3]; n],
        opacity_logits: vec![x; n],
        sh: vec![[x, 1.0, 2.0]; n],
        sh_degree: 0,
    }
}

fn trajectories(frames: u8) -> TabulatedScene {
    TabulatedScene::new((0..frames).map(|i| frame(i, 7)).collect()).unwrap()
}

fn write(dir: &Path, frames: u8) -> TabulatedScene {
    let scene = trajectories(frames);
    let times = TimeRange::UNIT.frames(frames.into());
    let mut seen = Vec::new();
    let options = WriteOptions::default();
    write_folder(dir, &scene, &times, &options, Existing::Refuse, &mut |done| seen.push(done))
        .unwrap();
    assert_eq!(seen, (1..=usize::from(frames)).collect::<Vec<_>>(), "progress");
    scene
}

#[test]
fn written_sequences_are_read_back() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("frames");
    let scene = write(&path, 12);
    let sequence = PlySequence::open(&path, &SequenceOptions::default()).unwrap();
    assert_eq!((sequence.num_splats(), sequence.num_frames()), (7, Some(12)), "size");
    for t in TimeRange::UNIT.frames(31) {
        assert_eq!(sequence.at(t).unwrap(), scene.at(t).unwrap(), "time {t}");
        let mut geometry = Splats::default();
        sequence.geometry_into(t, &mut geometry).unwrap();
        assert_eq!(geometry.means, scene.at(t).unwrap().means, "geometry at {t}");
    }
    assert!(matches!(sequence.at(1.1), Err(SceneError::Time { .. })), "outside");
    std::thread::scope(|scope| {
        for offset in 0..4_u8 {
            let (sequence, scene) = (&sequence, &scene);
            scope.spawn(move || {
                for i in 0..12_u8 {
                    let t = TimeRange::UNIT.frames(12)[usize::from((i * 5 + offset) % 12)];
                    assert_eq!(sequence.at(t).unwrap(), scene.at(t).unwrap(), "from many threads");
                }
            });
        }
    });
}

#[test]
fn archives_contain_the_same_files() {
    let dir = tempfile::tempdir().unwrap();
    let (folder, archive) = (dir.path().join("frames"), dir.path().join("frames.zip"));
    let scene = write(&folder, 3);
    let options = WriteOptions::default();
    write_zip(&archive, &scene, &[0.0, 0.5, 1.0], &options, Existing::Refuse, &mut |_| {}).unwrap();
    let bytes = fs::read(archive).unwrap();
    let mut at = 0;
    for i in 0..3 {
        let name = format!("frame_{i:05}.ply");
        let data = fs::read(folder.join(&name)).unwrap();
        // A streaming reader needs the local headers: signature, no flags,
        // stored, checksum, sizes, name at the root.
        let mut header = vec![0x50, 0x4b, 3, 4, 10, 0, 0, 0, 0, 0, 0, 0, 0x21, 0];
        let size = u32::try_from(data.len()).unwrap();
        header.extend(crc32fast::hash(&data).to_le_bytes());
        header.extend(size.to_le_bytes());
        header.extend(size.to_le_bytes());
        header.extend([15, 0, 0, 0]);
        header.extend(name.as_bytes());
        assert_eq!(&bytes[at..at + header.len()], header, "{name}");
        at += header.len();
        assert!(bytes[at..at + data.len()] == data, "{name}: data");
        at += data.len();
    }
    assert_eq!(&bytes[at..at + 4], b"PK\x01\x02", "then the directory");
}

#[test]
fn no_partial_output_remains() {
    #[derive(Debug)]
    struct Failing;
    impl DynamicScene for Failing {
        fn num_splats(&self) -> usize {
            7
        }
        fn sh_degree(&self) -> usize {
            0
        }
        fn time_range(&self) -> TimeRange {
            TimeRange::UNIT
        }
        fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
            if t > 0.6 {
                return Err(SceneError::Time { t, range: self.time_range() });
            }
            *out = frame(1, 7);
            Ok(())
        }
    }
    let dir = tempfile::tempdir().unwrap();
    let times = [0.0, 0.5, 1.0];
    let options = WriteOptions::default();
    let names = || fs::read_dir(dir.path()).unwrap().count();
    let folder = dir.path().join("f");
    let result = write_folder(&folder, &Failing, &times, &options, Existing::Refuse, &mut |_| {});
    assert!(matches!(result, Err(IoError::Scene { .. })), "{result:?}");
    let zip = dir.path().join("f.zip");
    let result = write_zip(&zip, &Failing, &times, &options, Existing::Refuse, &mut |_| {});
    assert!(result.is_err(), "{result:?}");
    let result = write_folder(&folder, &Failing, &[0.0], &options, Existing::Refuse, &mut |_| {});
    assert!(result.unwrap_err().to_string().contains("at least 2"), "one frame");
    let mut writer = FolderWriter::create(&folder, Existing::Refuse).unwrap();
    writer.push(&frame(0, 7), &options).unwrap();
    assert!(writer.finish().is_err(), "one frame");
    assert_eq!(names(), 0, "the folder is empty");
    write(&folder, 3);
    let scene = trajectories(2);
    let again =
        |existing| write_folder(&folder, &scene, &[0.0, 1.0], &options, existing, &mut |_| {});
    assert!(matches!(again(Existing::Refuse), Err(IoError::Exists { .. })), "not overwritten");
    again(Existing::Replace).unwrap();
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 2, "replaced when requested");
    assert!(dir.path().join(".f.c4d-files").is_file(), "the record of what was written");
    assert_eq!(names(), 2, "no leftovers");
}

#[test]
fn errors_of_folders_name_the_file() {
    let dir = tempfile::tempdir().unwrap();
    let open = || PlySequence::open(dir.path(), &SequenceOptions::default());
    assert!(open().unwrap_err().to_string().contains("at least 2"), "empty");
    let put = |name: &str, splats: &Splats| {
        ply::write_file(
            &dir.path().join(name),
            splats,
            &WriteOptions::default(),
            Existing::Replace,
        )
        .unwrap();
    };
    put("time_00000.ply", &frame(0, 7));
    assert!(open().unwrap_err().to_string().contains("1 numbered"), "one");
    put("time_00001.ply", &frame(1, 6));
    let error = open().unwrap_err().to_string();
    assert!(error.contains("time_00001.ply") && error.contains("6 Gaussians"), "{error}");
    put("time_00001.ply", &frame(1, 7).with_sh_degree(2));
    assert!(open().unwrap_err().to_string().contains("SH degree 2"), "degree");
    put("time_00001.ply", &frame(1, 7));
    put("time_00003.ply", &frame(3, 7));
    let error = open().unwrap_err().to_string();
    assert!(error.contains("time_00001.ply and time_00003.ply"), "{error}");
    put("time_00002.ply", &frame(2, 7));
    fs::write(dir.path().join("notes.txt"), b"").unwrap();
    let sequence = open().unwrap();
    assert_eq!(sequence.ignored(), ["notes.txt"], "other entries are reported");
    fs::write(dir.path().join("time_00002.ply"), b"ply\n").unwrap();
    let error = format!("{:#?}", sequence.frame(2).unwrap_err());
    assert!(error.contains("time_00002.ply"), "changed since: {error}");
}

#[test]
fn damaged_rows_are_invisible_in_their_frame() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("f");
    write(&path, 3);
    let mut damaged = frame(1, 7);
    damaged.means[2][0] = f32::NAN;
    damaged.quats[4] = [0.0; 4];
    ply::write_file(
        &path.join("frame_00001.ply"),
        &damaged,
        &WriteOptions::default(),
        Existing::Replace,
    )
    .unwrap();
    let lazy = PlySequence::open(&path, &SequenceOptions::default()).unwrap();
    assert!(lazy.at(0.0).is_ok(), "frame 0 is undamaged");
    let Err(SceneError::Source { source, .. }) = lazy.at(0.5) else { panic!("frame 1 is not") };
    assert!(source.to_string().contains("frame_00001.ply"), "{source}");
    let options = SequenceOptions { damage: Damage::Drop, cached_frames: 0, axes: None };
    let dropped = PlySequence::open(&path, &options).unwrap();
    assert_eq!(dropped.kept_rows(), None, "every row is valid in some frame");
    let repair = dropped.repair();
    assert_eq!((repair.not_finite, repair.zero_quaternion), (1, 1), "counted by kind");
    assert_eq!(repair.hidden, 2, "both are hidden");
    for t in [0.0, 0.3, 0.5, 1.0] {
        let splats = dropped.at(t).unwrap();
        assert_eq!(splats.len(), 7, "same rows at {t}");
        assert!((0..7).all(|i| splats.is_finite(i)), "whole at {t}");
        for row in 0..7 {
            // Between frames these rows are faded.
            let hidden = t == 0.5 && (row == 2 || row == 4);
            let visible = splats.opacity(row) >= 1.0 / 255.0;
            assert!(t == 0.3 || visible != hidden, "row {row} at {t}");
        }
    }
    let keep = SequenceOptions { damage: Damage::Keep, ..SequenceOptions::default() };
    let kept = PlySequence::open(&path, &keep).unwrap().at(0.5).unwrap();
    assert!(kept.means[2][0].is_nan(), "kept");
}
