use super::*;
use crate::import::take::PointKind;

/// A C3D file under construction: two points, three frames, one analog value a frame.
struct File {
    order: ByteOrder,
    real: bool,
    section: Vec<u8>,
    header_scale: f32,
    header_rate: f32,
    header_data_block: u16,
    parameter_block: u8,
    block_count: u8,
    mark: u8,
    frames: [u16; 2],
}

impl File {
    fn new(order: ByteOrder, real: bool) -> Self {
        let mark = match order {
            ByteOrder::Intel => 84,
            ByteOrder::Dec => 85,
            ByteOrder::Sgi => 86,
        };
        let header_scale = if real { -0.5 } else { 0.5 };
        let mut file = Self {
            order,
            real,
            section: Vec::new(),
            header_scale,
            header_rate: 50.0,
            header_data_block: 3,
            parameter_block: 2,
            block_count: 1,
            mark,
            frames: [1, 3],
        };
        file.section.extend(b"\x05\xffPOINT\x03\x00\x00");
        if order == ByteOrder::Sgi {
            file.section[7..9].copy_from_slice(&[0, 3]);
        }
        file.entry("UNITS", -1, &[2], b"mm");
        file.entry("Y_SCREEN", -1, &[2], b"+Z");
        file.entry("LABELS", -1, &[4, 2], b"A   B   ");
        file
    }

    fn word(&self, value: u16) -> [u8; 2] {
        if self.order == ByteOrder::Sgi {
            value.to_be_bytes()
        } else {
            value.to_le_bytes()
        }
    }

    fn real(&self, value: f32) -> [u8; 4] {
        match self.order {
            ByteOrder::Intel => value.to_le_bytes(),
            ByteOrder::Sgi => value.to_be_bytes(),
            ByteOrder::Dec => {
                // VAX F is IEEE times four with the 16-bit words swapped.
                let [a, b, c, d] = (value * 4.0).to_be_bytes();
                [b, a, d, c]
            }
        }
    }

    fn entry(&mut self, name: &str, kind: i8, dimensions: &[u8], value: &[u8]) {
        self.entry_of(1, name, kind, dimensions, value);
    }

    fn entry_of(&mut self, group: u8, name: &str, kind: i8, dimensions: &[u8], value: &[u8]) {
        let step = 5 + dimensions.len() + value.len();
        self.section.extend([name.len() as u8, group]);
        self.section.extend(name.as_bytes());
        let step = self.word(step as u16);
        self.section.extend(step);
        self.section.extend([kind as u8, dimensions.len() as u8]);
        self.section.extend(dimensions);
        self.section.extend(value);
        self.section.push(0);
    }

    fn with_word(mut self, name: &str, value: u16) -> Self {
        let value = self.word(value);
        self.entry(name, 2, &[], &value);
        self
    }

    fn with_real(mut self, name: &str, value: f32) -> Self {
        let value = self.real(value);
        self.entry(name, 4, &[], &value);
        self
    }

    /// Frame `f` holds A = (f, -2, 3), seen by cameras 0 and 2 with residual 2 steps; B = (4, 5, 6)
    /// is missing in frame 1.
    fn bytes(&self) -> Vec<u8> {
        let section = (usize::from(self.parameter_block) - 1) * BLOCK;
        let mut bytes = vec![0; section + BLOCK];
        bytes[..2].copy_from_slice(&[self.parameter_block, 0x50]);
        let words = [2, 1, self.frames[0], self.frames[1], 10];
        for (index, value) in words.into_iter().enumerate() {
            bytes[2 + 2 * index..][..2].copy_from_slice(&self.word(value));
        }
        bytes[12..16].copy_from_slice(&self.real(self.header_scale));
        bytes[16..18].copy_from_slice(&self.word(self.header_data_block));
        bytes[18..20].copy_from_slice(&self.word(1));
        bytes[20..24].copy_from_slice(&self.real(self.header_rate));
        bytes[section..section + 4].copy_from_slice(&[1, 0x50, self.block_count, self.mark]);
        bytes[section + 4..][..self.section.len()].copy_from_slice(&self.section);
        for frame in 0..3 {
            let seen = 5 * 256 + 2;
            let gone = if frame == 1 { -1 } else { 0 };
            for [x, y, z, last] in [[frame, -2, 3, seen], [4, 5, 6, gone]] {
                for value in [x, y, z, last] {
                    if self.real {
                        bytes.extend(self.real(value as f32));
                    } else {
                        bytes.extend(self.word(value as u16));
                    }
                }
            }
            if self.real {
                bytes.extend(self.real(9.0));
            } else {
                bytes.extend(self.word(9));
            }
        }
        bytes.resize(bytes.len().next_multiple_of(BLOCK), 0);
        bytes
    }

    fn read(&self) -> RawTake {
        read(&self.bytes()).unwrap()
    }

    /// Checks everything that does not depend on the trap.
    fn check(&self) -> RawTake {
        let take = self.read();
        let scale = if self.real { 1.0 } else { 0.5 };
        assert_eq!(take.labels, ["A", "B"]);
        assert_eq!((take.frame_count, take.rate), (3, 50.0));
        for frame in 0..3 {
            let a = [frame as f64, -2.0, 3.0].map(|value| value * scale);
            assert_eq!(take.position(frame, 0), Some(a));
            let b = [4.0, 5.0, 6.0].map(|value| value * scale);
            assert_eq!(take.position(frame, 1), (frame != 1).then_some(b));
        }
        assert_eq!((take.residuals[0], take.cameras[0]), (1.0, 5));
        assert_eq!(take.residuals[3], -1.0);
        take
    }
}

fn read(bytes: &[u8]) -> Result<RawTake, ImportError> {
    parse(bytes, "a.c3d", &TakeOptions::default())
}

#[test]
fn six_encodings_say_the_same() {
    for order in ByteOrder::ALL {
        for real in [false, true] {
            let take = File::new(order, real).check();
            assert_eq!(
                (take.unit, take.up),
                (LengthUnit::Millimetre, UpAxis::PlusZ)
            );
            let analog = Analog {
                channel_count: 1,
                samples_per_frame: 1,
            };
            assert_eq!(take.analog, Some(analog));
            // Small coordinates in mm are noticed; nothing else is odd.
            assert!(take.notices.len() <= 1, "{:?}", take.notices);
        }
    }
}

#[test]
fn the_parameter_section_may_stand_anywhere_and_state_no_length() {
    let mut file = File::new(ByteOrder::Intel, false);
    file.parameter_block = 11;
    file.header_data_block = 12;
    file.block_count = 0;
    file.check();
}

#[test]
fn the_data_is_found_by_the_header_the_parameter_or_after_the_section() {
    let mut file = File::new(ByteOrder::Dec, false).with_word("DATA_START", 0);
    file.check();
    file.header_data_block = 0;
    file.check();
    let mut file = File::new(ByteOrder::Intel, true).with_word("DATA_START", 3);
    file.header_data_block = 0;
    file.check();
    // A header that points behind the file.
    file.header_data_block = 900;
    file.check();
}

#[test]
fn contradictions_are_settled_by_the_length_of_the_file() {
    // Twice as many points would not end in the last block; nor would 500 frames fit.
    let mut file = File::new(ByteOrder::Intel, true)
        .with_word("USED", 40)
        .with_word("FRAMES", 500);
    let take = file.check();
    assert!(
        take.notices
            .iter()
            .any(|notice| notice.text.contains("POINT:USED says 40"))
    );
    file.frames = [1, 600];
    file.section.clear();
    file.section.extend(b"\x05\xffPOINT\x03\x00\x00");
    let file = file.with_word("FRAMES", 3);
    assert_eq!(file.read().frame_count, 3);
}

#[test]
fn header_and_parameter_scales_differ() {
    // Reals keep their values: the scale only says how large a residual step is.
    let file = File::new(ByteOrder::Intel, true).with_real("SCALE", -0.25);
    let take = file.read();
    assert_eq!(take.position(0, 0), Some([0.0, -2.0, 3.0]));
    assert_eq!(take.residuals[0], 0.5);
    // Integers are scaled to the size of a person: 7 steps in Y between A and B.
    for (parameter, header, wanted) in [(250.0, 1.0, 250.0), (1.0, 250.0, 250.0)] {
        let mut file = File::new(ByteOrder::Intel, false).with_real("SCALE", parameter);
        file.header_scale = header;
        let take = file.read();
        assert_eq!(
            take.position(1, 0),
            Some([1.0, -2.0, 3.0].map(|value| value * wanted))
        );
        assert_eq!(take.scale, Some(wanted as f32));
        assert!(
            take.notices
                .iter()
                .any(|notice| notice.text.contains("POINT:SCALE is"))
        );
    }
}

#[test]
fn without_a_point_group_the_header_serves() {
    let mut file = File::new(ByteOrder::Sgi, true);
    file.section.clear();
    file.block_count = 0;
    let take = file.read();
    assert_eq!(take.labels, ["*1", "*2"]);
    assert_eq!(take.kinds, [PointKind::Unlabelled; 2]);
    assert_eq!((take.frame_count, take.rate), (3, 50.0));
}

#[test]
fn a_rate_is_needed_and_the_caller_may_state_it() {
    let mut file = File::new(ByteOrder::Intel, true);
    file.header_rate = 0.0;
    let error = read(&file.bytes()).unwrap_err();
    assert!(matches!(error.kind, ImportErrorKind::Missing { .. }));
    let options = TakeOptions {
        rate: Some(25.0),
        ..TakeOptions::default()
    };
    assert_eq!(parse(&file.bytes(), "a.c3d", &options).unwrap().rate, 25.0);
    let wrong = TakeOptions {
        rate: Some(f64::NAN),
        ..TakeOptions::default()
    };
    assert!(parse(&file.bytes(), "a.c3d", &wrong).is_err());
    let file = file.with_real("RATE", 50.0);
    file.check();
}

#[test]
fn unknown_processor_is_guessed_or_refused() {
    for order in ByteOrder::ALL {
        let mut file = File::new(order, false);
        file.mark = 0;
        let take = file.check();
        assert!(
            take.notices[0].text.contains("processor byte"),
            "{:?}",
            take.notices
        );
    }
    let mut file = File::new(ByteOrder::Intel, false);
    file.mark = 0;
    file.header_rate = f32::NAN;
    let error = read(&file.bytes()).unwrap_err();
    assert_eq!(error.place, Place::Byte(515));
}

#[test]
fn zeros_before_the_header_move_every_place() {
    let mut file = File::new(ByteOrder::Intel, false);
    let mut bytes = vec![0; 7];
    bytes.extend(file.bytes());
    assert_eq!(read(&bytes).unwrap().frame_count, 3);
    file.mark = 0;
    file.header_rate = 0.0;
    let mut bytes = vec![0; 7];
    bytes.extend(file.bytes());
    assert_eq!(read(&bytes).unwrap_err().place, Place::Byte(522));
}

#[test]
fn a_take_longer_than_16_bits_without_a_longer_count_follows_the_length() {
    let mut file = File::new(ByteOrder::Intel, false);
    file.frames = [1, 65535];
    let mut bytes = file.bytes();
    bytes.truncate(1024);
    // 70,000 frames of 18 bytes, the last one not zero, then zeros to the end of the block.
    for _ in 0..70_000 {
        bytes.extend([1; 18]);
    }
    bytes.resize(bytes.len().next_multiple_of(BLOCK), 0);
    let take = read(&bytes).unwrap();
    assert_eq!(take.frame_count, 70_000);
}

#[test]
fn a_real_frame_count_and_the_fields_of_the_trial_serve_beyond_16_bits() {
    let mut file = File::new(ByteOrder::Sgi, true).with_real("LONG_FRAMES", 3.0);
    file.frames = [1, 65535];
    assert_eq!(file.check().first_frame, 1);
    let mut file = File::new(ByteOrder::Sgi, false);
    file.section.extend(b"\x05\xfeTRIAL\x00\x03\x00");
    for (name, low) in [
        ("ACTUAL_START_FIELD", 0x86a0),
        ("ACTUAL_END_FIELD", 0x86a2u16),
    ] {
        // Frames 100,000 to 100,002: two 16-bit words, the lower first.
        let words = [file.word(low), file.word(1)].concat();
        file.entry_of(2, name, 2, &[2], &words);
    }
    file.frames = [65535, 65535];
    assert_eq!(file.check().first_frame, 100_000);
}

#[test]
fn a_short_file_gives_its_whole_frames() {
    let file = File::new(ByteOrder::Intel, true);
    let bytes = file.bytes();
    // Frames of 36 bytes from 1024 on.
    let take = read(&bytes[..1024 + 36 * 2 + 35]).unwrap();
    assert_eq!(take.frame_count, 2);
    assert!(
        take.notices
            .iter()
            .any(|notice| notice.text.contains("3 frames announced, 2 whole"))
    );
    let error = read(&bytes[..1024 + 35]).unwrap_err();
    assert_eq!(error.place, Place::Byte(1024));
    assert!(matches!(
        error.kind,
        ImportErrorKind::Truncated {
            needed: 36,
            found: 35,
            ..
        }
    ));
}

#[test]
fn what_is_not_c3d_is_refused_with_its_place() {
    assert!(matches!(
        read(b"").unwrap_err().kind,
        ImportErrorKind::Empty
    ));
    assert!(matches!(
        read(b"HIERARCHY").unwrap_err().kind,
        ImportErrorKind::NotThisFormat { .. }
    ));
    assert!(matches!(
        read(&[0; 2000]).unwrap_err().kind,
        ImportErrorKind::NotThisFormat { .. }
    ));
    assert!(matches!(
        read(&[2, 0x50, 1]).unwrap_err().kind,
        ImportErrorKind::Truncated { .. }
    ));
    let mut bytes = File::new(ByteOrder::Intel, true).bytes();
    bytes[0] = 200;
    assert_eq!(read(&bytes).unwrap_err().place, Place::Byte(199 * 512));
    bytes[0] = 1;
    assert!(matches!(
        read(&bytes).unwrap_err().kind,
        ImportErrorKind::OutOfRange { .. }
    ));
    let mut file = File::new(ByteOrder::Intel, true);
    file.header_scale = 0.0;
    let error = read(&file.bytes()).unwrap_err();
    assert_eq!(error.place, Place::Byte(12));
}

#[test]
fn a_file_without_any_samples_has_no_frames() {
    let mut bytes = File::new(ByteOrder::Intel, true).bytes();
    bytes[2..6].copy_from_slice(&[0; 4]);
    let take = read(&bytes).unwrap();
    assert_eq!((take.point_count(), take.frame_count), (0, 0));
    assert!(
        take.notices
            .iter()
            .any(|notice| notice.text.contains("holds no points"))
    );
}

#[test]
fn nan_and_infinite_coordinates_are_missing() {
    let mut bytes = File::new(ByteOrder::Intel, true).bytes();
    bytes[1024..1028].copy_from_slice(&f32::NAN.to_le_bytes());
    bytes[1040..1044].copy_from_slice(&f32::INFINITY.to_le_bytes());
    let take = read(&bytes).unwrap();
    assert_eq!((take.position(0, 0), take.position(0, 1)), (None, None));
    assert_eq!((take.residuals[0], take.cameras[0]), (-1.0, 0));
    assert!(
        take.notices
            .iter()
            .any(|notice| notice.text.contains("1 samples are infinite"))
    );
}
