# Needs: validated trees, and a configuration without placeholders.
# Makes: commits and a tag on the Hub with --config send=true, and config/releases/; otherwise only shows the plan.


rule upload:
    # What is on the Hub is no result of this machine: the rule makes no file and runs whenever it is asked for.
    input:
        trees=uploads,
        firewall=rules.firewall.output,
    log:
        "logs/upload.log",
    params:
        cfg=cfg("packaging"),
        records=SETTINGS["records"],
        # On the command line it is text.
        really=str(SETTINGS["send"]).lower() == "true",
    script:
        "../scripts/upload.py"
