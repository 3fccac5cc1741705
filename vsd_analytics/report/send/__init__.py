"""How a finished mail leaves: SMTP or the mail program of the machine, and a record of what was sent."""
