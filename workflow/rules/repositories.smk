# Which sequences each repository has, and what of them was taken down: the functions that the rule files ask.


def takedowns_of(wildcards):
    """Takedowns within the sequence; one that went whole is not planned at all."""
    return [entry for entry in TAKEDOWNS if entry["sequence"] == wildcards.id]


def has_regions(name):
    return any(entry["region"] for entry in TAKEDOWNS if entry["sequence"] == name)


def tree_takedowns(wildcards):
    """Takedowns of sequences that are, or were, in a tree; a subset knows of its own only."""
    names = {
        row.id
        for row in ROWS
        if repository_of(row) == wildcards.repository
        and (not SUBSET or row.id in SUBSET)
    }
    return [entry for entry in TAKEDOWNS if entry["sequence"] in names]


def tree_reviews(wildcards):
    """Reviews of the ground truth of the sequences of a tree."""
    return {
        sequence.id: REVIEWS[sequence.id]
        for sequence in in_tree(wildcards.repository)
        if sequence.id in REVIEWS
    }


def earlier_releases(wildcards):
    """Files of the records of earlier releases of a repository; none for a subset, which is no release."""
    version = SETTINGS["packaging"]["release"]["version"]
    records = latest_records(Path(SETTINGS["records"]), wildcards.repository, version)
    return [
        str(path)
        for record in ([] if SUBSET else records)
        for path in sorted(record.rglob("*"))
        if path.is_file()
    ]


def repository_of(row):
    """The repository of a row of the sheet: by its licence, and its batch where that has several."""
    terms = LICENSES["licenses"][license_of(row.country, LICENSES)]
    return batch_repository(terms["repository"], BATCHES.get(row.id, 1))


def in_tree(repository):
    return [
        sequence
        for sequence in SEQUENCES.values()
        if repository_of(sequence) == repository
    ]


def tree_packages(wildcards):
    return expand(
        rules.package.output.inventory,
        id=[sequence.id for sequence in in_tree(wildcards.repository)],
    )


def tree_splits(wildcards):
    chosen = [
        sequence.id
        for sequence in in_tree(wildcards.repository)
        if has(sequence, "camera_left")
    ]
    return expand(rules.splits.output.splits, id=chosen)


def tree_poses(wildcards):
    chosen = [
        sequence.id
        for sequence in in_tree(wildcards.repository)
        if has(sequence, "camera_left") and has_poses(sequence)
    ]
    return expand(rules.poses.output.poses, id=chosen)


def commercial_sequences(wildcards):
    """Sequences with frames by repository, of the repositories whose licence permits commercial use."""
    return {
        repository: [
            sequence.id
            for sequence in in_tree(repository)
            if has(sequence, "camera_left")
        ]
        for repository, spdx in REPOSITORIES.items()
        if LICENSES["licenses"][spdx]["commercial"]
    }


def commercial_splits(wildcards):
    names = sum(commercial_sequences(wildcards).values(), [])
    return expand(rules.splits.output.splits, id=names)


def validations():
    """All trees, an emptied one too; of a subset just those that it has sequences for."""
    repositories = [name for name in REPOSITORIES if in_tree(name) or not SUBSET]
    return expand(rules.validate_tree.output.validation, repository=repositories)


def tree_sums(wildcards):
    repositories = [name for name in REPOSITORIES if in_tree(name) or not SUBSET]
    return expand(rules.assemble.output.sums, repository=repositories)


def uploads(wildcards):
    """Validations of all trees; part of a release must not take the place of the whole one on the Hub."""
    if SUBSET:
        raise WorkflowError(
            "card: part of a release cannot be uploaded; leave out --config sequences"
        )
    return validations()
